// closed_curves_test.cpp with a thousand curves in each block.

#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "tests/cutting/closed_curves.h"

namespace trocar::cutting::testing {
namespace {

TEST(ClosedCurvesCampaign, InARegularBlock) {
  const auto faults = draw_many(0, 1000);
  EXPECT_EQ(faults.size(), 0u) << fmt::format("{}", fmt::join(faults, "\n"));
}
TEST(ClosedCurvesCampaign, InAJitteredBlock) {
  const auto faults = draw_many(0.2, 1000);
  EXPECT_EQ(faults.size(), 0u) << fmt::format("{}", fmt::join(faults, "\n"));
}

}  // namespace
}  // namespace trocar::cutting::testing
