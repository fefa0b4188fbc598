// Resection is what cutting is for: whatever closed curve a blade draws, what is inside comes free.

#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "tests/cutting/closed_curves.h"

namespace trocar::cutting::testing {
namespace {

// The aim is none; docs/limits.md says how many there are.
TEST(ClosedCurves, FreeWhatTheySurroundInARegularBlock) {
  const auto faults = draw_many(0, 140);
  EXPECT_LE(faults.size(), 2u) << fmt::format("{}", fmt::join(faults, "\n"));
}
TEST(ClosedCurves, FreeWhatTheySurroundInAJitteredBlock) {
  const auto faults = draw_many(0.2, 140);
  EXPECT_LE(faults.size(), 2u) << fmt::format("{}", fmt::join(faults, "\n"));
}

}  // namespace
}  // namespace trocar::cutting::testing
