#include "client/ui/fonts.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "client/ui/hud.h"

// Draws without a display. Set TROCAR_PICTURES to a folder to keep the picture and look at it.

namespace trocar::ui {
namespace {

class FontsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto context = render::make_headless_context({1280, 720});
    ASSERT_TRUE(context.ok()) << context.error().message;
    context_ = std::move(*context);
    hud_.emplace(*context_, 1.0);
  }
  render::Image draw(const std::vector<std::string>& names) {
    HudModel model;
    for (const auto& name : names) model.participants.push_back({.name = name});
    for (int i = 0; i < 3; ++i) {
      hud_->begin_frame(1.0f / 60);
      hud_->draw(model);
      hud_->render();
    }
    return context_->read_image();
  }
  std::unique_ptr<render::GlContext> context_;
  std::optional<Hud> hud_;
};

TEST_F(FontsTest, LettersOfNamesAreAddedAsTheyArrive) {
  draw({"Ada"});
  EXPECT_TRUE(hud_->fonts().has('A'));
  EXPECT_FALSE(hud_->fonts().has(U'Д'));
  EXPECT_FALSE(hud_->fonts().has(U'李'));
  const auto image = draw({"Дарья", "李小龙", "Ελένη"});
  for (const char32_t letter : U"Дарья李小龙Ελένη")
    if (letter != 0) {
      EXPECT_TRUE(hud_->fonts().has(letter)) << std::hex << static_cast<unsigned>(letter);
    }
  // A name is another picture than as many question marks.
  EXPECT_NE(image.rgb, draw({"?????", "???", "?????"}).rgb);
  if (const char* folder = std::getenv("TROCAR_PICTURES")) {
    draw({"Дарья", "李小龙", "Ελένη", "Zoë"});
    EXPECT_TRUE(render::write_png(context_->read_image(), std::string(folder) + "/names.png").ok());
  }
}

TEST_F(FontsTest, WhatNoFontHasIsAQuestionMarkAndNothingBreaks) {
  // Unassigned since ever, beyond the first plane, and bytes that are no text.
  draw({"\xe0\xa7\xbf\xef\xb7\x90", "\xf0\x9f\xa9\xba", "\xff\xfe"});
  EXPECT_FALSE(hud_->fonts().has(0xfdd0));
  EXPECT_FALSE(hud_->fonts().has(0x1fa7a));
}

TEST_F(FontsTest, NamesOfManyLettersAreBounded) {
  std::string all;
  for (unsigned letter = 0x4e00; letter < 0x4e00 + 2 * kMostAddedLetters; ++letter) {
    all += static_cast<char>(0xe0 | letter >> 12);
    all += static_cast<char>(0x80 | (letter >> 6 & 0x3f));
    all += static_cast<char>(0x80 | (letter & 0x3f));
  }
  draw({all});
  EXPECT_TRUE(hud_->fonts().has(0x4e00));
  EXPECT_FALSE(hud_->fonts().has(0x4e00 + kMostAddedLetters));
}

}  // namespace
}  // namespace trocar::ui
