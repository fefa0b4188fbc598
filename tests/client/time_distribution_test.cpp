#include "client/replica/time_distribution.h"

#include <gtest/gtest.h>

namespace trocar::replica {
namespace {

TEST(TimeDistribution, QuantilesAreWithinAMillisecond) {
  TimeDistribution times;
  EXPECT_EQ(times.quantile_ms(0.5), 0);
  for (int i = 1; i <= 1000; ++i) times.add(i);
  EXPECT_EQ(times.count(), 1000u);
  EXPECT_NEAR(times.quantile_ms(0.5), 500, 1);
  EXPECT_NEAR(times.quantile_ms(0.99), 990, 1);
  EXPECT_NEAR(times.quantile_ms(1), 1000, 1);
}

TEST(TimeDistribution, TakesTimesBeyondItsEnds) {
  TimeDistribution times;
  times.add(-5);
  times.add(1e9);
  EXPECT_NEAR(times.quantile_ms(0.5), 0, 1);
  EXPECT_NEAR(times.quantile_ms(1), 20'000, 2);
}

}  // namespace
}  // namespace trocar::replica
