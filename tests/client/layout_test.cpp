#include <gtest/gtest.h>

#include <utility>

#include "client/ui/hud.h"

// Draws without a display, over black: what is lit is a panel.

namespace trocar::ui {
namespace {

// All that can stand in the window of a surgeon at once.
HudModel full_model() {
  HudModel model;
  model.title = "operating-theatre-4.hospital.example:7690";
  model.organ = "liver";
  model.vertices = 12'345;
  model.own_role = "instructor, Maximiliane";
  model.frozen_text = "Maximiliane keeps your tools where they are.";
  model.surface_age_ms = 1200;
  model.figures.pace.rate.time_rate = 0.4f;
  model.shows_help = model.has_own_tool = model.can_mark = model.shows_rate = true;
  for (const char* name : {"force on your right hand", "force on your left hand"})
    model.own_forces.push_back({name, {}, 1.2f});
  model.tray = {.names = {"all", "probe", "grasper", "toothed", "scissors", "scalpel", "hook"},
                .texts = {"", "", "", "", "", "", ""},
                .hands = 2};
  model.messages.push_back({"Bo holds this tissue. Wait, or ask Bo to let go.", 1, true});
  for (const char* name : {"Maximiliane", "Bo", "Konstantinos", "Ada"})
    model.participants.push_back(
        {.name = name, .role = replica::Role::Surgeon, .has_tool = true, .force_n = 1});
  return model;
}

TEST(Layout, TheMiddleOfTheOrganStaysFree) {
  for (const render::Size size : {render::Size{1280, 720}, {1920, 1080}, {3840, 2160}})
    for (const auto& [scale, is_research] : {std::pair{0.0, true},
                                             {0.75, true},
                                             {1.0, true},
                                             {1.0, false},
                                             {3.0, true},
                                             {3.0, false}}) {
      auto context = render::make_headless_context(size);
      ASSERT_TRUE(context.ok()) << context.error().message;
      Hud hud(**context, scale);
      for (int i = 0; i < 3; ++i) {
        hud.begin_frame(1.0f / 60);
        auto model = full_model();
        model.shows_rate = is_research;
        hud.draw(model);
        hud.render();
      }
      const auto image = (*context)->read_image();
      int lit = 0;
      // A tenth of the window each way, about its middle.
      for (int y = size.height * 9 / 20; y < size.height * 11 / 20; ++y)
        for (int x = size.width * 9 / 20; x < size.width * 11 / 20; ++x)
          lit += image.rgb[static_cast<std::size_t>(y * size.width + x) * 3 + 1] > 3;
      EXPECT_EQ(lit, 0) << size.width << "x" << size.height << " at scale " << scale;
    }
}

// A recorded lesson with all its results at the right, with or without the keys.
render::Image recorded_lesson(bool shows_help) {
  auto context = render::make_headless_context({1280, 720});
  EXPECT_TRUE(context.ok());
  Hud hud(**context, 1);
  HudModel model;
  model.shows_help = shows_help;
  model.timeline = HudTimeline{.last_seconds = 60};
  model.participants.push_back({.name = "Mira", .role = replica::Role::Surgeon, .has_tool = true});
  model.lesson = HudLesson{.title = "Cut along the line", .is_over = true, .points = 92};
  model.lesson->results.emplace_back("Incision", std::vector<std::string>(12, "a measure: 1.0 N"));
  for (int i = 0; i < 3; ++i) {
    hud.begin_frame(1.0f / 60);
    hud.draw(model);
    hud.render();
  }
  return (*context)->read_image();
}

// The column at the right begins 296 pixels before the edge; the organ ends before it.
TEST(Layout, TheKeysStandBesideTheOrgan) {
  const auto without = recorded_lesson(false), with = recorded_lesson(true);
  int changed = 0;
  for (int y = 0; y < 530; ++y)
    for (int x = 300; x < 1280 - 296; ++x) {
      const auto at = static_cast<std::size_t>(y * 1280 + x) * 3;
      changed += without.rgb[at + 1] != with.rgb[at + 1];
    }
  EXPECT_EQ(changed, 0);
}

TEST(Layout, TheKeysOfARecordingDoNotCoverItsLesson) {
  const auto without = recorded_lesson(false), with = recorded_lesson(true);
  int changed = 0;
  for (int y = 0; y < 380; ++y)
    for (int x = 1280 - 290; x < 1280; ++x) {
      const auto at = static_cast<std::size_t>(y * 1280 + x) * 3;
      changed += without.rgb[at + 1] != with.rgb[at + 1];
    }
  EXPECT_EQ(changed, 0);
}

// Two recordings of long names, with all that their panels can say.
HudModel pair_model(render::Size size) {
  HudModel model;
  HudPair pair{.is_by_stage = true, .has_stages = true};
  const int left = size.width / 2;
  for (std::size_t i = 0; i < 2; ++i) {
    HudHalf& half = pair.halves[i];
    half.name = "trocar-20261121T120000Z-operating-theatre-4-second-attempt.mcap";
    half.organ = "liver";
    half.last_seconds = 600;
    half.stage = "stage 2 of 3: Hold the tissue for the other";
    half.blood = "blood lost 154.2 ml";
    half.notice = "This stage is over here; it waits for the other.";
    half.left = static_cast<float>(i == 0 ? 0 : left);
    half.width = static_cast<float>(i == 0 ? left : size.width - left);
    for (const char* name : {"Maximiliane", "Konstantinos"})
      half.participants.push_back(
          {.name = name, .role = replica::Role::Surgeon, .has_tool = true, .force_n = 1});
  }
  model.pair = std::move(pair);
  model.timeline = HudTimeline{.last_seconds = 600};
  return model;
}

TEST(Layout, OfTwoRecordingsTheMiddleOfBothStaysFree) {
  for (const render::Size size : {render::Size{1280, 720}, {1920, 1080}, {3840, 2160}})
    for (const double scale : {0.0, 1.0, 3.0}) {
      auto context = render::make_headless_context(size);
      ASSERT_TRUE(context.ok()) << context.error().message;
      Hud hud(**context, scale);
      for (int i = 0; i < 3; ++i) {
        hud.begin_frame(1.0f / 60);
        hud.draw(pair_model(size));
        hud.render();
      }
      const auto image = (*context)->read_image();
      for (const int middle : {size.width / 4, size.width * 3 / 4}) {
        int lit = 0;
        for (int y = size.height * 9 / 20; y < size.height * 11 / 20; ++y)
          for (int x = middle - size.width / 40; x < middle + size.width / 40; ++x)
            lit += image.rgb[static_cast<std::size_t>(y * size.width + x) * 3 + 1] > 3;
        EXPECT_EQ(lit, 0) << size.width << "x" << size.height << " at scale " << scale;
      }
    }
}

}  // namespace
}  // namespace trocar::ui
