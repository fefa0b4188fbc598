#include "client/haptics/fulcrum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/support/random.h"

namespace trocar::haptics {
namespace {

constexpr Vec3d kPort{0.02, 0.12, 0.15}, kTip{0.01, 0.03, 0.05};
constexpr double kLength_m = 0.3;

void expect_near(const Vec3d& a, const Vec3d& b, double tolerance) {
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(a.z, b.z, tolerance);
}

TEST(Fulcrum, TheShaftPassesThePortAndHasItsLength) {
  Fulcrum fulcrum(kPort, kTip, kLength_m);
  ASSERT_TRUE(fulcrum.is_in_reach());
  const Vec3d start = fulcrum.handle_m();
  expect_near(fulcrum.move(start, {}).position_m, kTip, 1e-12);
  for (const Vec3d& way : {Vec3d{0.02, 0, 0}, Vec3d{0, -0.03, 0.01}, Vec3d{-0.01, 0.02, -0.02}}) {
    const auto tip = fulcrum.move(start + way, {});
    EXPECT_NEAR(length(start + way - tip.position_m), kLength_m, 1e-9);
    const Vec3d shaft = (start + way - tip.position_m) / kLength_m;
    EXPECT_NEAR(length(cross(shaft, kPort - tip.position_m)), 0, 1e-9);
    expect_near(to_double(rotate(tip.orientation, {0, 0, 1})), shaft, 1e-6);
  }
}

TEST(Fulcrum, SidewaysTheTipIsMirroredAndAlongItGoesWithTheHand) {
  Fulcrum fulcrum({0, 0, 0.1}, {0, 0, 0}, kLength_m);
  const Vec3d start = fulcrum.handle_m();
  expect_near(start, {0, 0, 0.3}, 1e-12);
  // The handle is twice as far from the port as the tip.
  const Vec3d right = fulcrum.move(start + Vec3d{0.001, 0, 0}, {}).position_m;
  EXPECT_NEAR(right.x, -0.0005, 1e-7);
  EXPECT_NEAR(fulcrum.move(start - Vec3d{0, 0, 0.02}, {}).position_m.z, -0.02, 1e-12);
}

TEST(Fulcrum, WhatIsOutOfReachIsSaid) {
  EXPECT_FALSE(Fulcrum(kPort, kPort, kLength_m).is_in_reach());
  EXPECT_FALSE(Fulcrum({0, 0, 0.28}, {}, kLength_m).is_in_reach());
  EXPECT_TRUE(Fulcrum({0, 0, 0.26}, {}, kLength_m).is_in_reach());
}

TEST(Fulcrum, HandleAndTipStopAtThePort) {
  Fulcrum fulcrum({0, 0, 0.1}, {0, 0, 0}, kLength_m);
  EXPECT_NEAR(fulcrum.move({0, 0, 0.11}, {}).position_m.z, 0.1 - 0.27, 1e-9);
  EXPECT_NEAR(fulcrum.at_handle({0, 0, 1}, {}).force_n.z, 0, 1e-12) << "it does not slide";
  EXPECT_NEAR(fulcrum.move({0, 0, 0.5}, {}).position_m.z, 0.095, 1e-9);
  fulcrum.move({0, 0, 0.1}, {});
  EXPECT_TRUE(is_finite(fulcrum.at_handle({1, 1, 1}, {0.1, 0.1, 0.1}).force_n)) << "in the port";
}

// A turn from a to b as a vector, for turns of which the sine is the angle.
Vec3d turn(const Quatf& a, const Quatf& b) {
  const Quatf way = b * conjugate(a);
  return Vec3d{way.x, way.y, way.z} * (way.w < 0 ? -2.0 : 2.0);
}

TEST(Fulcrum, VirtualWorkAtTheHandleIsThatAtTheTip) {
  trocar::testing::Random random(7);
  const auto any = [&](double size) {
    const auto number = [&] { return random.between(-size, size); };
    const double x = number(), y = number();
    return Vec3d{x, y, number()};
  };
  Fulcrum fulcrum(kPort, kTip, kLength_m);
  const Vec3d start = fulcrum.handle_m();
  for (int k = 0; k < 200; ++k) {
    const Vec3d place = start + any(0.04);
    const Vec3d tilt = any(0.3);
    const auto orientation = normalized(Quatf{
        static_cast<float>(tilt.x), static_cast<float>(tilt.y), static_cast<float>(tilt.z), 1});
    const Vec3d force_n = any(3), torque_nm = any(0.2);
    const Vec3d way = any(0.002), roll = any(0.02);
    const auto turned =
        normalized(Quatf{static_cast<float>(roll.x / 2), static_cast<float>(roll.y / 2),
                         static_cast<float>(roll.z / 2), 1} *
                   orientation);
    // Half a step to both sides: the error is of third order.
    const auto back =
        normalized(Quatf{static_cast<float>(-roll.x / 2), static_cast<float>(-roll.y / 2),
                         static_cast<float>(-roll.z / 2), 1} *
                   orientation);
    const auto before = fulcrum.move(place - way, back);
    const auto after = fulcrum.move(place + way, turned);
    fulcrum.move(place, orientation);
    const auto load = fulcrum.at_handle(force_n, torque_nm);
    const double tip_j = dot(force_n, after.position_m - before.position_m) +
                         dot(torque_nm, turn(before.orientation, after.orientation));
    const double handle_j = dot(load.force_n, way) * 2 + dot(load.torque_nm, turn(back, turned));
    EXPECT_NEAR(handle_j, tip_j, 2e-5 + 1e-3 * std::abs(tip_j));
  }
}

}  // namespace
}  // namespace trocar::haptics
