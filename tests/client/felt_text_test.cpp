#include "client/ui/felt_text.h"

#include <gtest/gtest.h>

namespace trocar::ui {
namespace {

TEST(FeltText, SaysWhatALoopDoesInWordsAndFigures) {
  FeltHandFigures figures{.device = "calculated hand",
                          .has_priority = true,
                          .rate_hz = 999.7,
                          .late_median_us = 21.2,
                          .late_95_us = 30,
                          .late_99_us = 45,
                          .overruns = 2,
                          .answer_age_ms = 12.4,
                          .echo_ms = 38.3,
                          .hand_n = 0.421,
                          .server_n = 0.437,
                          .motion_scale = 1.5,
                          .force_scale = 0.5};
  auto text = describe(figures);
  EXPECT_EQ(text.loop, "1000 per second, 2 too long");
  EXPECT_EQ(text.lateness, "21 us median, 30 us p95, 45 us p99");
  EXPECT_EQ(text.answers, "12 ms old, 38 ms after their pose");
  EXPECT_EQ(text.force, "0.42 N in the hand, 0.44 N by the server");
  EXPECT_EQ(text.scale, "motion x 1.5, force x 0.5");
  EXPECT_EQ(text.safeguards, "none so far");

  figures.has_priority = false;
  figures.limited[4] = 250;
  figures.limited[6] = 12;
  text = describe(figures);
  EXPECT_EQ(text.loop, "1000 per second, 2 too long, without priority");
  EXPECT_EQ(text.safeguards, "ramp 0.25 s, slew 0.012 s");
}

TEST(FeltText, BeforeTheFirstAnswerThereIsNone) {
  EXPECT_EQ(describe(FeltHandFigures{}).answers, "none yet");
}

}  // namespace
}  // namespace trocar::ui
