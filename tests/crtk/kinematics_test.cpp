#include "client/crtk/kinematics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace trocar::crtk {
namespace {

// The arm's published table (modified Denavit-Hartenberg), multiplied out link by link in double
// precision: an own way from joints to tip.
using Matrix = std::array<std::array<double, 4>, 4>;

Matrix operator*(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j)
      for (int k = 0; k < 4; ++k) c[i][j] += a[i][k] * b[k][j];
  return c;
}

Matrix link(double alpha, double a, double theta, double d) {
  const double ca = std::cos(alpha), sa = std::sin(alpha), ct = std::cos(theta),
               st = std::sin(theta);
  return {{{ct, -st, 0, a},
           {st * ca, ct * ca, -sa, -d * sa},
           {st * sa, ct * sa, ca, d * ca},
           {0, 0, 0, 1}}};
}

Matrix large_needle_driver(const Joints& q) {
  constexpr double kQuarter = std::numbers::pi / 2;
  const Matrix tip{{{0, -1, 0, 0}, {0, 0, 1, 0.0102}, {-1, 0, 0, 0}, {0, 0, 0, 1}}};
  return link(kQuarter, 0, q[0] + kQuarter, 0) * link(-kQuarter, 0, q[1] - kQuarter, 0) *
         link(kQuarter, 0, 0, q[2] - 0.4318) * link(0, 0, q[3], 0.4162) *
         link(-kQuarter, 0, q[4] - kQuarter, 0) * link(-kQuarter, 0.0091, q[5] - kQuarter, 0) * tip;
}

const Joints kSome[] = {{0, 0, 0.1, 0, 0, 0},
                        {0.3, -0.2, 0.12, 0.7, 0.4, -0.5},
                        {-1.1, 0.6, 0.05, -2.9, -1.2, 1.3},
                        {0.9, 0.8, 0.2, 3.0, 1.1, 0.9}};

TEST(Kinematics, TheTipIsWhereThePublishedTableHasIt) {
  const Kinematics arm;
  for (const auto& joints : kSome) {
    const auto table = large_needle_driver(joints);
    const auto tip = arm.tip_at(joints);
    EXPECT_NEAR(tip.position.x, table[0][3], 1e-7);
    EXPECT_NEAR(tip.position.y, table[1][3], 1e-7);
    EXPECT_NEAR(tip.position.z, table[2][3], 1e-7);
    const Vec3f axes[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int column = 0; column < 3; ++column) {
      const auto axis = rotate(tip.orientation, axes[column]);
      EXPECT_NEAR(axis.x, table[0][column], 1e-6);
      EXPECT_NEAR(axis.y, table[1][column], 1e-6);
      EXPECT_NEAR(axis.z, table[2][column], 1e-6);
    }
  }
}

TEST(Kinematics, JointsOfATipAreThoseThatBroughtItThere) {
  for (const bool has_wrist : {true, false}) {
    const Kinematics arm{has_wrist};
    for (auto joints : kSome) {
      if (!has_wrist) joints[4] = joints[5] = 0;
      const auto found = arm.joints_of(arm.tip_at(joints), joints);
      for (std::size_t i = 0; i < kMostJoints; ++i) EXPECT_NEAR(found[i], joints[i], 1e-4) << i;
    }
  }
}

TEST(Kinematics, ARollGoesOnBeyondHalfATurn) {
  const Kinematics arm;
  Joints joints{0, 0, 0.1, 0, 0, 0};
  for (double roll = 0; roll < 4.5; roll += 0.1) {
    joints[3] = roll;
    joints = arm.reach(arm.tip_at(joints), joints).joints;
    EXPECT_NEAR(joints[3], roll, 1e-4);
  }
  // And beyond its limit it comes from the other side.
  joints[3] = 4.6;
  EXPECT_NEAR(arm.reach(arm.tip_at(joints), joints).joints[3], 4.6 - 2 * std::numbers::pi, 1e-4);
}

TEST(Kinematics, WhatIsOutOfReachIsLimitedAndNamed) {
  const Kinematics arm;
  const Joints at{0, 0, 0.1, 0, 0, 0};
  auto far = arm.tip_at(at);
  far.position.z = -0.4f;
  const auto deep = arm.reach(far, at);
  EXPECT_EQ(deep.limit, "outer_insertion");
  EXPECT_NEAR(deep.tip.position.z, -(0.24 - 0.0156 + 0.0193), 1e-5);

  // The wrist bends no further; the tip stays where it should be.
  Joints bent = at;
  bent[4] = 1.5;
  const auto target = arm.tip_at(bent);
  const auto turned = arm.reach(target, at);
  EXPECT_EQ(turned.limit, "outer_wrist_pitch");
  EXPECT_LT(length(turned.tip.position - target.position), 1e-4f);
  EXPECT_GT(angle_between(turned.tip.orientation, target.orientation), 0.05);

  EXPECT_EQ(arm.reach(arm.tip_at(at), at).limit, "");
}

TEST(Kinematics, AnArmWithoutAWristPointsAlongItsShaft) {
  const Kinematics arm{false};
  const Joints at{0.2, -0.1, 0.1, 0.5, 0, 0};
  auto target = arm.tip_at(at);
  target.orientation = {1, 0, 0, 0};
  const auto reached = arm.reach(target, at);
  EXPECT_EQ(reached.limit, "shaft, which has no wrist");
  EXPECT_LT(length(reached.tip.position - target.position), 1e-6f);
}

}  // namespace
}  // namespace trocar::crtk
