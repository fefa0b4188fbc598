#include "client/ui/rate_text.h"

#include <gtest/gtest.h>

#include <limits>

namespace trocar::ui {
namespace {

wire::FrameFigures figures(wire::RateLevel level) {
  wire::FrameFigures figures;
  figures.solve.layer_sweeps = {4, 3, 2, 1};
  figures.near.node_limit = 1050;
  auto& rate = figures.pace.rate;
  rate.level = level;
  rate.budget_us = 800;
  rate.predicted_us = 612;
  rate.lowered = 1234;
  rate.raised = 7;
  return figures;
}

TEST(RateText, SaysWhatIsDecidedInWordsAndFigures) {
  const auto text = describe(figures(wire::RateLevel::Reduced));
  EXPECT_EQ(text.level, "less detail, to keep pace");
  EXPECT_EQ(text.sweeps, "4 at the tools, then 3, 2, 1");
  EXPECT_EQ(text.load, "612 of 800 us");
  EXPECT_EQ(text.changes, "1,234 down, 7 up");
  EXPECT_EQ(text.banner, "");
  EXPECT_EQ(text.tone, RateTone::Notice);
  EXPECT_EQ(describe(figures(wire::RateLevel::Full)).tone, RateTone::Calm);
  EXPECT_EQ(describe(figures(wire::RateLevel::Overloaded)).tone, RateTone::Warning);
}

TEST(RateText, WithoutAControllerThereIsLittleToSay) {
  const auto text = describe(wire::FrameFigures{});
  EXPECT_EQ(text.level, "fixed detail");
  EXPECT_EQ(text.sweeps + text.load + text.changes + text.banner, "");
}

TEST(RateText, SlowTimeIsToldAtAnyLevel) {
  for (const auto level :
       {wire::RateLevel::Fixed, wire::RateLevel::Full, wire::RateLevel::Overloaded}) {
    auto slow = figures(level);
    slow.pace.rate.time_rate = 0.624f;
    const auto text = describe(slow);
    EXPECT_NE(text.banner.find("62 %"), std::string::npos) << text.banner;
    EXPECT_EQ(text.tone == RateTone::Warning, level == wire::RateLevel::Overloaded);
    slow.pace.rate.time_rate = 0.995f;
    EXPECT_EQ(describe(slow).banner, "");
  }
}

TEST(RateText, AbsurdNumbersStayNumbers) {
  auto absurd = figures(wire::RateLevel::Full);
  absurd.pace.rate.budget_us = std::numeric_limits<float>::denorm_min();
  absurd.pace.rate.predicted_us = std::numeric_limits<float>::max();
  EXPECT_EQ(describe(absurd).load, "1,000,000,000 of 0 us");
}

}  // namespace
}  // namespace trocar::ui
