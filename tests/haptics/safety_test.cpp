#include "client/haptics/safety.h"

#include <gtest/gtest.h>

#include <cmath>

namespace trocar::haptics {
namespace {

constexpr device::DeviceLimits kDevice{
    .force_n = 3.3, .torque_nm = 0.05, .rate_hz = 1000, .stiffness_n_m = 1000};
constexpr double kDt_s = 0.001;

bool has(const SafeForce& safe, Limit limit) {
  return (safe.limits & (1u << static_cast<unsigned>(limit))) != 0;
}

class SafetyChain : public ::testing::Test {
 protected:
  SafetyChain() {
    for (int k = 0; k < 300; ++k) safety_.step(input_);
  }
  SafeForce settle(int steps = 100) {
    SafeForce safe;
    for (int k = 0; k < steps; ++k) safe = safety_.step(input_);
    return safe;
  }
  Safety safety_{kDevice};
  SafetyInput input_;  // at rest, past the ramp
};

TEST_F(SafetyChain, AWellBehavedForcePasses) {
  input_.force_n = {0.2, 0.1, 0};
  input_.torque_nm = {0, 0.004, 0};
  const SafeForce safe = safety_.step(input_);
  EXPECT_EQ(safe.limits, 0u);
  EXPECT_EQ(safe.force_n, input_.force_n);
  EXPECT_EQ(safe.torque_nm, input_.torque_nm);
}

TEST_F(SafetyChain, WhatIsNoNumberIsZeroAtOnce) {
  for (int part = 0; part < 4; ++part) {
    input_ = {};
    input_.force_n = {1, 0, 0};
    settle(400);
    if (part == 0) input_.force_n.y = NAN;
    if (part == 1) input_.torque_nm.z = INFINITY;
    if (part == 2) input_.position_m.x = NAN;
    if (part == 3) input_.stiffness_n_m = NAN;
    const SafeForce safe = safety_.step(input_);
    EXPECT_EQ(length(safe.force_n), 0);
    EXPECT_EQ(length(safe.torque_nm), 0);
    EXPECT_TRUE(has(safe, Limit::NotFinite));
  }
}

TEST_F(SafetyChain, AStaleReadingIsZeroAtOnceAndRampsAfterwards) {
  input_.force_n = {1, 0, 0};
  EXPECT_NEAR(settle().force_n.x, 1, 1e-12);
  input_.reading_age_s = 0.021;
  SafeForce safe = safety_.step(input_);
  EXPECT_EQ(length(safe.force_n), 0);
  EXPECT_TRUE(has(safe, Limit::StaleReading));
  input_.reading_age_s = NAN;
  EXPECT_EQ(length(safety_.step(input_).force_n), 0);
  input_.reading_age_s = 0;
  safe = settle(126);
  EXPECT_NEAR(safe.force_n.x, 0.5, 0.01);
  EXPECT_TRUE(has(safe, Limit::Ramp));
  EXPECT_NEAR(settle(130).force_n.x, 1, 1e-12);
}

TEST_F(SafetyChain, AJumpOfTheDeviceIsZeroAtOnce) {
  input_.force_n = {1, 0, 0};
  settle();
  input_.position_m.y = 0.06;
  const SafeForce safe = safety_.step(input_);
  EXPECT_EQ(length(safe.force_n), 0);
  EXPECT_TRUE(has(safe, Limit::Jump));
  EXPECT_FALSE(has(safety_.step(input_), Limit::Jump));
}

TEST_F(SafetyChain, AnOldPatchFadesInContactOnly) {
  input_.force_n = {1, 0, 0};
  input_.touches = true;
  input_.patch_age_s = 0.25;
  EXPECT_NEAR(settle().force_n.x, 1, 1e-12);
  input_.patch_age_s = 0.5;
  const SafeForce safe = settle();
  EXPECT_NEAR(safe.force_n.x, std::exp(-1.0), 1e-9);
  EXPECT_TRUE(has(safe, Limit::OldPatch));
  input_.touches = false;
  EXPECT_NEAR(settle().force_n.x, 1, 1e-12);
}

TEST_F(SafetyChain, TheForceComesBackSlowlyWithTheAnswers) {
  input_.force_n = {1, 0, 0};
  input_.touches = true;
  settle();
  input_.patch_age_s = 3;
  EXPECT_LT(settle().force_n.x, 1e-4);
  input_.patch_age_s = 0;
  double last_n = safety_.step(input_).force_n.x;
  EXPECT_LT(last_n, 0.005);
  for (int k = 0; k < 249; ++k) {
    const double force_n = safety_.step(input_).force_n.x;
    EXPECT_LT(force_n - last_n, 0.005);
    last_n = force_n;
  }
  EXPECT_NEAR(settle(5).force_n.x, 1, 1e-12);
}

TEST_F(SafetyChain, TheForceChangesByAtMostThreeTenthsOfANewtonInAMillisecond) {
  input_.force_n = {2, 0, 0};
  input_.torque_nm = {0.04, 0, 0};
  SafeForce safe = safety_.step(input_);
  EXPECT_NEAR(length(safe.force_n), 0.3, 1e-12);
  EXPECT_NEAR(length(safe.torque_nm), 0.009, 1e-12);
  EXPECT_TRUE(has(safe, Limit::Slew));
  input_.force_n = {-2, 3, 1};
  Vec3d last_n = safe.force_n;
  for (int k = 0; k < 50; ++k) {
    safe = safety_.step(input_);
    EXPECT_LE(length(safe.force_n - last_n), 0.3 + 1e-12);
    last_n = safe.force_n;
  }
  input_.force_n = {};
  settle(100);
  input_.force_n = {3, 0, 0};
  input_.dt_s = 0.1;
  EXPECT_LE(length(safety_.step(input_).force_n), 0.6 + 1e-12) << "a late step";
}

TEST_F(SafetyChain, TheDeviceIsNotAskedForMoreThanItHas) {
  input_.force_n = {3, 4, 0};
  input_.torque_nm = {0, 0.3, 0.4};
  const SafeForce safe = settle();
  EXPECT_NEAR(length(safe.force_n), 3.3, 1e-9);
  EXPECT_NEAR(safe.force_n.y / safe.force_n.x, 4.0 / 3, 1e-9);
  EXPECT_NEAR(length(safe.torque_nm), 0.05, 1e-9);
  EXPECT_TRUE(has(safe, Limit::Device));
  EXPECT_GT(safety_.counts()[static_cast<std::size_t>(Limit::Device)], 0u);
}

TEST(Safety, ADeviceWithoutTorqueGetsNone) {
  Safety safety({.force_n = 3.3});
  SafetyInput input;
  input.torque_nm = {0.01, 0, 0};
  for (int k = 0; k < 300; ++k) EXPECT_EQ(length(safety.step(input).torque_nm), 0);
}

TEST(Safety, BeginsFromNothing) {
  Safety safety(kDevice);
  SafetyInput input;
  input.force_n = {1, 0, 0};
  EXPECT_EQ(length(safety.step(input).force_n), 0);
  for (int k = 0; k < 125; ++k) safety.step(input);
  EXPECT_NEAR(safety.step(input).force_n.x, 0.5, 0.01);
}

// A force that leads the motion by a quarter of a period feeds it.
TEST_F(SafetyChain, AForceThatFeedsAMotionIsDamped) {
  const auto work_of = [](double damping_n_s_m) {
    SafetySettings settings;
    settings.most_damping_n_s_m = damping_n_s_m;
    Safety safety(kDevice, settings);
    double work_j = 0;
    Vec3d last_m, last_n;
    for (int k = 0; k < 3000; ++k) {
      const double angle = 2 * M_PI * k * kDt_s;
      SafetyInput input;
      input.position_m = {0.003 * std::sin(angle), 0, 0};
      input.force_n = {0.3 * std::cos(angle), 0, 0};
      input.stiffness_n_m = 100;
      if (k > 0) work_j += dot(last_n, input.position_m - last_m);
      last_m = input.position_m;
      last_n = safety.step(input).force_n;
    }
    return work_j;
  };
  EXPECT_GT(work_of(0), 0.005);
  EXPECT_LT(work_of(6), 0.65 * work_of(0));
  EXPECT_LT(work_of(100), 0.001);
}

// Sampling a spring feeds as much as a damping of its stiffness times half a step takes: less than
// that of any tissue.
TEST_F(SafetyChain, ADampedSpringIsLeftAlone) {
  Vec3d last_m;
  for (int k = 0; k < 3000; ++k) {
    input_.position_m = {0.005 * std::sin(2 * M_PI * k * kDt_s), 0, 0};
    const Vec3d velocity_m_s = (input_.position_m - last_m) / kDt_s;
    last_m = input_.position_m;
    input_.force_n = input_.position_m * -100.0 - velocity_m_s * 0.2;
    input_.stiffness_n_m = 100;
    safety_.step(input_);
  }
  EXPECT_EQ(safety_.counts()[static_cast<std::size_t>(Limit::Passivity)], 0u);
}

TEST(Safety, LimitsHaveNames) {
  for (std::size_t i = 0; i < kLimits; ++i) EXPECT_STRNE(name_of(static_cast<Limit>(i)), "unknown");
}

}  // namespace
}  // namespace trocar::haptics
