// Sampling and anchors, against values worked out by hand and against a brute-force reference.

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "common/tool/script.h"

namespace trocar::tool {
namespace {

ScriptTool two_keys(Ease ease) {
  ScriptTool tool;
  tool.ease = ease;
  tool.keys = {{1.0, {0, 0, 0}, {0, 0, 1}, Verb::Push},
               {3.0, {0.4f, 0, 0}, {1, 0, 0}, Verb::Grasp}};
  return tool;
}

TEST(ScriptSample, HoldsTheFirstKeyBeforeItAndTheLastAfterIt) {
  const auto tool = two_keys(Ease::Linear);
  const auto before = sample(tool, 0.0, {});
  EXPECT_EQ(before.world_from_tool.position, (Vec3f{0, 0, 0}));
  EXPECT_EQ(before.verb, Verb::Push);
  const auto after = sample(tool, 99.0, {});
  EXPECT_EQ(after.world_from_tool.position, (Vec3f{0.4f, 0, 0}));
  EXPECT_EQ(after.verb, Verb::Grasp);
}

TEST(ScriptSample, LinearAndSmoothMeetHalfWayAndDifferElsewhere) {
  EXPECT_NEAR(sample(two_keys(Ease::Linear), 2.0, {}).world_from_tool.position.x, 0.2, 1e-6);
  EXPECT_NEAR(sample(two_keys(Ease::Smooth), 2.0, {}).world_from_tool.position.x, 0.2, 1e-6);
  EXPECT_NEAR(sample(two_keys(Ease::Linear), 1.5, {}).world_from_tool.position.x, 0.1, 1e-6);
  // 3 t^2 - 2 t^3 at t = 1/4 is 0.15625.
  EXPECT_NEAR(sample(two_keys(Ease::Smooth), 1.5, {}).world_from_tool.position.x, 0.0625, 1e-6);
}

TEST(ScriptSample, TheVerbChangesExactlyAtItsKey) {
  const auto tool = two_keys(Ease::Smooth);
  EXPECT_EQ(sample(tool, std::nextafter(3.0, 0.0), {}).verb, Verb::Push);
  EXPECT_EQ(sample(tool, 3.0, {}).verb, Verb::Grasp);
}

TEST(ScriptSample, TheShaftTurnsFromOneDirectionToTheOther) {
  const auto tool = two_keys(Ease::Linear);
  const auto shaft = [&](double t) {
    return rotate(sample(tool, t, {}).world_from_tool.orientation, Vec3f{0, 0, 1});
  };
  EXPECT_NEAR(length(shaft(1.0) - Vec3f{0, 0, 1}), 0, 1e-6);
  EXPECT_NEAR(length(shaft(2.0) - Vec3f{std::sqrt(0.5f), 0, std::sqrt(0.5f)}), 0, 1e-6);
  EXPECT_NEAR(length(shaft(3.0) - Vec3f{1, 0, 0}), 0, 1e-6);
}

TEST(ScriptSample, ALoopRepeatsAndDoesNotJump) {
  ScriptTool tool = two_keys(Ease::Smooth);
  tool.loops = true;
  tool.keys[0].time_s = 0;
  tool.keys.push_back({4.0, tool.keys[0].position_m, tool.keys[0].shaft, Verb::None});
  for (double t = 0; t < 4; t += 0.125) {
    const auto once = sample(tool, t, {});
    const auto later = sample(tool, t + 4 * 25, {});
    EXPECT_EQ(once, later) << t;
  }
  const auto end = sample(tool, 4.0 - 1e-9, {});
  EXPECT_NEAR(length(end.world_from_tool.position - tool.keys[0].position_m), 0, 1e-6);
}

// Unit cube around the origin, side 0.2 m, outward triangles.
struct Cube {
  std::vector<Vec3f> positions;
  std::vector<SurfaceTriangle> triangles;
  Cube() {
    for (int i = 0; i < 8; ++i)
      positions.push_back({i & 1 ? 0.1f : -0.1f, i & 2 ? 0.1f : -0.1f, i & 4 ? 0.1f : -0.1f});
    triangles = {{0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}, {0, 1, 5}, {0, 5, 4},
                 {2, 6, 7}, {2, 7, 3}, {0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}};
  }
};

TEST(ScriptAnchors, TheRayLeavesTheCubeWhereItShould) {
  const Cube cube;
  // Off the diagonals, on the face x = +0.1.
  const Vec3f direction = normalized(Vec3f{1, 0.3f, -0.2f}, {});
  const auto anchor = find_anchor({direction}, cube.positions, cube.triangles);
  ASSERT_TRUE(anchor.ok());
  EXPECT_NEAR(length(anchor->position - Vec3f{0.1f, 0.03f, -0.02f}), 0, 1e-6);
  EXPECT_GT(anchor->axis_z.x, 0.5f) << "normal points outward";
}

TEST(ScriptAnchors, TheFarthestOfSeveralHitsCounts) {
  Cube cube;
  const auto inner_count = cube.positions.size();
  for (std::size_t i = 0; i < inner_count; ++i) cube.positions.push_back(cube.positions[i] * 2.0f);
  // The larger cube first in the list: order must not matter.
  std::vector<SurfaceTriangle> both;
  for (auto t : cube.triangles) both.push_back({t[0] + 8, t[1] + 8, t[2] + 8});
  both.insert(both.end(), cube.triangles.begin(), cube.triangles.end());
  const auto anchor = find_anchor({Vec3f{0, 1, 0}}, cube.positions, both);
  ASSERT_TRUE(anchor.ok());
  EXPECT_NEAR(anchor->position.y, 0.2, 1e-6);
}

TEST(ScriptAnchors, ExtremeAndMissedRaysTakeTheFarthestVertex) {
  Cube cube;
  const auto extreme = find_anchor({normalized(Vec3f{-1, -2, 3}, {}), AnchorOn::Extreme},
                                   cube.positions, cube.triangles);
  ASSERT_TRUE(extreme.ok());
  EXPECT_EQ(extreme->position, (Vec3f{-0.1f, -0.1f, 0.1f}));
  for (auto& p : cube.positions) p += Vec3f{1, 0, 0};  // now the ray along -x misses
  const auto missed =
      find_anchor({normalized(Vec3f{-1, 0.1f, 0}, {})}, cube.positions, cube.triangles);
  ASSERT_TRUE(missed.ok());
  EXPECT_NEAR(missed->position.x, 0.9, 1e-6);
  EXPECT_NEAR(missed->position.y, 0.1, 1e-6);
}

TEST(ScriptAnchors, AxesAreARightHandedTriadWithZOutwardEverywhere) {
  const Cube cube;
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  for (int i = 0; i < 2000; ++i) {
    const Vec3f d = normalized(Vec3f{normal(random), normal(random), normal(random)}, {0, 0, 1});
    const auto a =
        find_anchor({d, AnchorOn::Ray, AnchorFrame::Normal}, cube.positions, cube.triangles);
    ASSERT_TRUE(a.ok());
    const float far =
        std::max({std::abs(a->position.x), std::abs(a->position.y), std::abs(a->position.z)});
    ASSERT_NEAR(far, 0.1f, 1e-6f) << "on the cube";
    ASSERT_NEAR(length(cross(a->position, d)), 0, 1e-6f) << "on the ray";
    ASSERT_GT(dot(a->axis_z, d), 0) << "outward";
    ASSERT_NEAR(length(cross(a->axis_x, a->axis_y) - a->axis_z), 0, 1e-5f);
    ASSERT_NEAR(dot(a->axis_x, a->axis_y), 0, 1e-5f);
    if (std::abs(a->axis_z.y) < 0.99f) {
      ASSERT_GT(a->axis_y.y, 0) << "y goes up";
      ASSERT_NEAR(a->axis_x.y, 0, 1e-6f) << "x is horizontal";
    }
  }
}

TEST(ScriptAnchors, NormalFramePutsZAlongTheNormalAndWorldFrameDoesNot) {
  const Cube cube;
  ScriptTool tool;
  tool.anchor = ScriptAnchor{{0, 1, 0}, AnchorOn::Ray, AnchorFrame::Normal};
  tool.keys = {{0, {0, 0, 0.05f}, {0, 0, 1}, Verb::None}};
  auto anchor = find_anchor(*tool.anchor, cube.positions, cube.triangles);
  ASSERT_TRUE(anchor.ok());
  anchor->axis_z = {0, 1, 0};  // the exact face normal, for round numbers
  anchor->axis_x = {1, 0, 0};
  anchor->axis_y = {0, 0, -1};
  const Pose outward = sample(tool, 0, *anchor).world_from_tool;
  EXPECT_NEAR(length(outward.position - Vec3f{0, 0.15f, 0}), 0, 1e-6);
  EXPECT_NEAR(length(rotate(outward.orientation, {0, 0, 1}) - Vec3f{0, 1, 0}), 0, 1e-6);
  tool.anchor->frame = AnchorFrame::World;
  const Pose world = sample(tool, 0, *anchor).world_from_tool;
  EXPECT_NEAR(length(world.position - Vec3f{0, 0.1f, 0.05f}), 0, 1e-6);
  EXPECT_NEAR(length(rotate(world.orientation, {0, 0, 1}) - Vec3f{0, 0, 1}), 0, 1e-6);
}

TEST(ScriptAnchors, NoSurfaceAndBadIndicesAreErrors) {
  Cube cube;
  EXPECT_FALSE(find_anchor({{0, 1, 0}}, cube.positions, {}).ok());
  EXPECT_FALSE(find_anchor({{0, 1, 0}}, {}, cube.triangles).ok());
  cube.triangles[5][1] = 8;
  EXPECT_FALSE(find_anchor({{0, 1, 0}}, cube.positions, cube.triangles).ok());
}

}  // namespace
}  // namespace trocar::tool
