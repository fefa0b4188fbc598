// Pictures that a server sends: what is one becomes a texture, and all else an error.

#include "client/render/image_texture.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "client/render/gl_context.h"
#include "common/lesson/lesson_texts.h"
#include "tests/support/files.h"

namespace trocar::render {
namespace {

class ImageTextureTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto context = make_headless_context({64, 64});
    ASSERT_TRUE(context.ok()) << context.error().message;
    context_ = std::move(*context);
  }
  static std::string png_of(int width, int height) {
    const trocar::testing::TemporaryFolder folder;
    const auto file = folder.file("image.png");
    const auto bytes = static_cast<std::size_t>(3 * width * height);
    EXPECT_TRUE(write_png({{width, height}, std::vector<std::uint8_t>(bytes, 128)}, file));
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  std::unique_ptr<GlContext> context_;
};

TEST_F(ImageTextureTest, TakesPngAndTheJpegOfALesson) {
  ImageTexture texture;
  ASSERT_TRUE(texture.load(png_of(30, 20)));
  EXPECT_NE(texture.name(), 0u);
  EXPECT_EQ(texture.width(), 30);
  EXPECT_EQ(texture.height(), 20);
  ASSERT_FALSE(lesson::lesson_pictures().empty());
  for (const auto& picture : lesson::lesson_pictures())
    EXPECT_TRUE(texture.load(std::string(picture.bytes))) << picture.name;
  EXPECT_GT(texture.width(), 100);
}

TEST_F(ImageTextureTest, WhatIsNoPictureLeavesNone) {
  ImageTexture texture;
  const auto good = png_of(30, 20);
  ASSERT_TRUE(texture.load(good));
  for (const auto& bad : {std::string(), std::string("words"), good.substr(0, good.size() / 2),
                          std::string("\xff\xd8\xff\xe0 and no more")}) {
    EXPECT_FALSE(texture.load(bad));
    EXPECT_EQ(texture.name(), 0u);
    EXPECT_EQ(texture.width(), 0);
  }
}

TEST_F(ImageTextureTest, WhatIsTooLargeIsRefused) {
  ImageTexture texture;
  EXPECT_TRUE(texture.load(png_of(kMostImageSide, 1)));
  EXPECT_FALSE(texture.load(png_of(kMostImageSide + 1, 1)));
  EXPECT_EQ(texture.name(), 0u);
}

}  // namespace
}  // namespace trocar::render
