#include "client/ui/start_screen.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "client/ui/hud.h"

// Draws without a display. Set TROCAR_PICTURES to a folder to keep the picture and look at it.

namespace trocar::ui {
namespace {

class StartScreenTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto context = render::make_headless_context({1280, 560});
    ASSERT_TRUE(context.ok()) << context.error().message;
    context_ = std::move(*context);
    hud_.emplace(*context_);
  }
  std::optional<StartChoice> draw(bool is_entered = false) {
    hud_->begin_frame(1.0f / 60);
    const auto choice = screen_.draw(model_, is_entered);
    hud_->render();
    return choice;
  }
  // Pixels that are clearly lighter than the ground.
  std::size_t lit() const {
    const auto image = context_->read_image();
    std::size_t count = 0;
    for (const auto value : image.rgb) count += value > 100;
    return count;
  }

  std::unique_ptr<render::GlContext> context_;
  std::optional<Hud> hud_;
  StartModel model_;
  StartScreen screen_{{.server = "10.0.0.7:7690",
                       .code = "7K3M-9QXZ-4T2B-WN8C",
                       .name = "Ada",
                       .role = replica::Role::Instructor}};
};

TEST_F(StartScreenTest, EnterJoinsWithWhatStandsInTheFields) {
  EXPECT_FALSE(draw());
  EXPECT_FALSE(screen_.is_touched());
  const auto choice = draw(true);
  ASSERT_TRUE(choice);
  EXPECT_EQ(choice->deed, StartDeed::Join);
  EXPECT_EQ(choice->server, "10.0.0.7:7690");
  EXPECT_EQ(choice->code, "7K3M-9QXZ-4T2B-WN8C");
  EXPECT_EQ(choice->name, "Ada");
  EXPECT_EQ(choice->role, replica::Role::Instructor);
  EXPECT_TRUE(screen_.is_touched());
}

TEST_F(StartScreenTest, ShowsSessionsAndWhyATryFailed) {
  for (int i = 0; i < 3; ++i) draw();
  const auto empty = lit();
  model_.sessions = {{"Lesson one", "liver", "192.168.1.20:7690", 3, true},
                     {"stomach at theatre-2", "stomach", "192.168.1.31:7690", 1, true},
                     {"this machine", "", "127.0.0.1:7690", 0, false}};
  for (int i = 0; i < 3; ++i) draw();
  const auto listed = lit();
  EXPECT_GT(listed, empty + 2000);
  model_.message =
      "server: join code: this server knows no such code, check the last eight "
      "characters";
  for (int i = 0; i < 3; ++i) draw();
  EXPECT_GT(lit(), listed + 500);
  if (const char* folder = std::getenv("TROCAR_PICTURES")) {
    const auto saved =
        render::write_png(context_->read_image(), std::string(folder) + "/start.png");
    EXPECT_TRUE(saved.ok());
  }
}

// The lesson that runs is shown at once, with its codes, and Enter takes part in it.
TEST_F(StartScreenTest, TurnsToTheLessonThatRuns) {
  for (int i = 0; i < 3; ++i) draw();
  model_.lesson = StartLesson{.address = "theatre-1:7690",
                              .codes = {"surgeon: 7K3M-9QXZ-4T2B-WN8C"},
                              .recording = "lesson.mcap"};
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(draw());
  const auto choice = draw(true);
  ASSERT_TRUE(choice);
  EXPECT_EQ(choice->deed, StartDeed::TakePart);
  if (const char* folder = std::getenv("TROCAR_PICTURES")) {
    const auto saved =
        render::write_png(context_->read_image(), std::string(folder) + "/lesson.png");
    EXPECT_TRUE(saved.ok());
  }
}

}  // namespace
}  // namespace trocar::ui
