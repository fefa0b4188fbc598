#include "client/ui/rate_text.h"

#include <gtest/gtest.h>

#include <limits>

namespace trocar::ui {
namespace {

replica::RateFigures figures(replica::RateLevel level) {
  replica::RateFigures rate;
  rate.level = level;
  rate.layer_sweeps = {4, 3, 2, 1};
  rate.node_limit = 1050;
  rate.budget_us = 800;
  rate.predicted_us = 612;
  rate.lowered = 1234;
  rate.raised = 7;
  return rate;
}

TEST(RateText, SaysWhatIsDecidedInWordsAndFigures) {
  const auto text = describe(figures(replica::RateLevel::Reduced));
  EXPECT_EQ(text.level, "less detail, to keep pace");
  EXPECT_EQ(text.sweeps, "4 at the tools, then 3, 2, 1");
  EXPECT_EQ(text.load, "612 of 800 us");
  EXPECT_EQ(text.changes, "1,234 down, 7 up");
  EXPECT_EQ(text.banner, "");
  EXPECT_EQ(text.tone, RateTone::Notice);
  EXPECT_EQ(describe(figures(replica::RateLevel::Full)).tone, RateTone::Calm);
  EXPECT_EQ(describe(figures(replica::RateLevel::Overloaded)).tone, RateTone::Warning);
}

TEST(RateText, WithoutAControllerThereIsLittleToSay) {
  const auto text = describe({});
  EXPECT_EQ(text.level, "fixed detail");
  EXPECT_EQ(text.sweeps + text.load + text.changes + text.banner, "");
}

TEST(RateText, SlowTimeIsToldAtAnyLevel) {
  for (const auto level :
       {replica::RateLevel::Fixed, replica::RateLevel::Full, replica::RateLevel::Overloaded}) {
    auto rate = figures(level);
    rate.time_rate = 0.624f;
    const auto text = describe(rate);
    EXPECT_NE(text.banner.find("62 %"), std::string::npos) << text.banner;
    EXPECT_EQ(text.tone == RateTone::Warning, level == replica::RateLevel::Overloaded);
    rate.time_rate = 0.995f;
    EXPECT_EQ(describe(rate).banner, "");
  }
}

TEST(RateText, AbsurdNumbersStayNumbers) {
  auto rate = figures(replica::RateLevel::Full);
  rate.budget_us = std::numeric_limits<float>::denorm_min();
  rate.predicted_us = std::numeric_limits<float>::max();
  EXPECT_EQ(describe(rate).load, "1,000,000,000 of 0 us");
}

}  // namespace
}  // namespace trocar::ui
