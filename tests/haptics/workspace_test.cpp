#include "client/haptics/workspace.h"

#include <gtest/gtest.h>

namespace trocar::haptics {
namespace {

constexpr Vec3d kStart{0.1, 0.2, 0.3};

void expect_at(const Vec3d& a, const Vec3d& b, double tolerance = 1e-8) {
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(a.z, b.z, tolerance);
}

TEST(Workspace, StartsWhereItIsToldAndScales) {
  Workspace workspace(kStart, {.motion = 2, .force = 1});
  expect_at(workspace.move({0.05, 0, 0}, {}, false).position_m, kStart);
  expect_at(workspace.move({0.06, 0.01, 0}, {}, false).position_m, kStart + Vec3d{0.02, 0.02, 0});
}

TEST(Workspace, TheClutchMovesTheDeviceAlone) {
  Workspace workspace(kStart);
  workspace.move({}, {}, false);
  const Vec3d before = workspace.move({0.02, 0, 0}, {}, false).position_m;
  expect_at(workspace.move({0.01, 0, 0}, {}, true).position_m, before);
  expect_at(workspace.move({-0.02, 0, 0}, {}, true).position_m, before);
  expect_at(workspace.move({-0.01, 0, 0}, {}, false).position_m, before + Vec3d{0.01, 0, 0});
}

TEST(Workspace, AViewTurnsMotionsButMovesNothing) {
  Workspace workspace(kStart);
  workspace.move({}, {}, false);
  const Vec3d before = workspace.move({0.01, 0.02, 0.03}, {}, false).position_m;
  const Quatf view = rotation_from_z({1, 0, 0});  // what is towards the person is along x
  workspace.set_view(view);
  expect_at(workspace.move({0.01, 0.02, 0.03}, {}, false).position_m, before);
  const auto tip = workspace.move({0.01, 0.02, 0.04}, {}, false);
  expect_at(tip.position_m, before + Vec3d{0.01, 0, 0});
  expect_at(to_double(rotate(tip.orientation, {0, 0, 1})), {1, 0, 0}, 1e-6);
}

TEST(Workspace, ANewScaleMovesNothing) {
  Workspace workspace(kStart);
  workspace.move({}, {}, false);
  const Vec3d before = workspace.move({0.01, 0, 0}, {}, false).position_m;
  workspace.set_scale({.motion = 0.5, .force = 1});
  expect_at(workspace.move({0.01, 0, 0}, {}, false).position_m, before);
  expect_at(workspace.move({0.02, 0, 0}, {}, false).position_m, before + Vec3d{0.005, 0, 0});
}

TEST(Workspace, AForceComesBackTheWayTheMotionWent) {
  Workspace workspace(kStart, {.motion = 2, .force = 0.5});
  workspace.set_view(rotation_from_z(to_float(normalized(Vec3d{1, 2, -1}, {0, 0, 1}))));
  workspace.move({}, {}, false);
  const Vec3d way_m{0.001, -0.002, 0.004}, force_n{0.3, 0.2, -0.1};
  const Vec3d tool_way_m = workspace.move(way_m, {}, false).position_m - kStart;
  // With both scales the work at the device is the tool's times force over motion scale.
  EXPECT_NEAR(dot(workspace.device_force(force_n), way_m), dot(force_n, tool_way_m) * 0.5 / 2,
              1e-9);
  expect_at(workspace.device_torque(force_n), workspace.device_force(force_n) / 2.0);
  EXPECT_NEAR(workspace.device_stiffness(100), 100, 1e-9);
  EXPECT_NEAR(workspace.world_stiffness(workspace.device_stiffness(70)), 70, 1e-9);
}

}  // namespace
}  // namespace trocar::haptics
