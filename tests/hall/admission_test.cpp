#include "server/hall/plan/admission.h"

#include <gtest/gtest.h>

namespace trocar::hall {
namespace {

Load load(const std::string& name, double cores) {
  return {.name = name, .cores = cores, .is_overloaded = false, .tick_p99_s = 0.5e-3};
}

TEST(Admission, TakesWhatFitsUpToTheLastCore) {
  EXPECT_TRUE(admit({}, "liver", 1, 1));
  EXPECT_TRUE(admit({load("a", 0.4)}, "liver", 0.6, 1));
  EXPECT_TRUE(admit({load("a", 0.1), load("b", 0.2)}, "liver", 0.7, 1))
      << "rounding refuses nobody";
}

TEST(Admission, RefusesWithTheNumbers) {
  const auto refused = admit({load("a", 0.45), load("b", 0.3)}, "liver", 0.5, 1);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::Refused);
  EXPECT_EQ(refused.error().message,
            "liver needs 0.50 cores, and 0.75 of 1.00 are taken (a 0.45, b 0.30): end a session "
            "first");
}

TEST(Admission, SaysWhatNoSessionLessWouldHelp) {
  const auto refused = admit({}, "liver", 1.5, 1);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("raise cores"), std::string::npos)
      << refused.error().message;
}

TEST(Admission, RefusesWhileASessionFallsBehind) {
  auto slow = load("slow", 0.1);
  slow.is_overloaded = true;
  slow.tick_p99_s = 1.25e-3;
  const auto refused = admit({slow}, "liver", 0.1, 8);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("slow falls behind real time"), std::string::npos);
  EXPECT_NE(refused.error().message.find("1.25 ms"), std::string::npos);
}

TEST(Admission, WhatIsDeclaredWinsOverWhatWasMeasuredAndThatOverAGuess) {
  EXPECT_EQ(expected_cores(0.3, 0.7, 2), 0.3);
  EXPECT_EQ(expected_cores(std::nullopt, 0.7, 2), 0.7);
  EXPECT_EQ(expected_cores(std::nullopt, std::nullopt, 2), 2 * kUnknownCores);
}

TEST(Admission, ASessionTakesAtLeastThePartOfRealTimeOfItsTicks) {
  EXPECT_DOUBLE_EQ(measured_cores(2.5, 5, 0.1e-3), 0.5);
  EXPECT_DOUBLE_EQ(measured_cores(0.5, 5, 0.8e-3), 0.8);
  EXPECT_DOUBLE_EQ(measured_cores(1, 0, 0), 0);
  EXPECT_DOUBLE_EQ(measured_cores(-1, 5, 0), 0);
}

}  // namespace
}  // namespace trocar::hall
