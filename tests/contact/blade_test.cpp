// A thin flat blade, pressed at constant speed into a liver: its force grows steadily with depth
// and is that of a thicker one, up to where the points at its ends reach the greatest pressure and
// stop it. With room for 2,048 points, of which it has 4,000, and a face as stiff as that of a thin
// tip, a blade of 2 mm laid flat jumped by four times its mean force.

#include <gtest/gtest.h>

#include <cmath>

#include "tests/contact/scene_fixture.h"

namespace trocar::contact::testing {
namespace {

constexpr int kTicks = 300;
// How deep: on its edge a blade of 2 mm is stopped at 4 mm.
constexpr float kFlat_m = 0.008f, kEdge_m = 0.003f;

enum class Side { Flat, Edge };

struct Press {
  double mean_n = 0;          // over the second half of the way
  double largest_jump_n = 0;  // there: change of force less the mean of the changes on both sides
  float left_behind_m = 0;    // of the hand, at the end
  bool has_dropped = false;
};

Vec3f highest_free_node(const organ::Organ& organ) {
  Vec3f top{0, -1, 0};
  for (const auto node : organ.mesh.surface_nodes) {
    const Vec3f p = to_float(organ.mesh.rest_positions[node.value]);
    const bool is_fixed = std::ranges::find(organ.fixed_nodes, node) != organ.fixed_nodes.end();
    if (!is_fixed && p.y > top.y) top = p;
  }
  return top;
}

Press press(const organ::Organ& organ, Side side, float radius) {
  const float deepest = side == Side::Edge ? kEdge_m : kFlat_m;
  const Vec3f top = highest_free_node(organ);
  const float shaft = 0.04f;
  HandScene scene(organ);
  scene.join(0, {.radius_m = radius, .length_m = shaft, .half_width_m = 0.015f});
  const auto pose_at = [&](float depth) {
    return side == Side::Edge
               ? upright(top - Vec3f{0, depth, 0})
               : Pose{top + Vec3f{-0.5f * shaft, radius - depth, 0}, rotation_from_z({1, 0, 0})};
  };
  scene.hold(0, pose_at(-0.003f), 40);
  Press result;
  std::array<double, 3> forces{};
  for (int tick = 1; tick <= kTicks; ++tick) {
    scene.put(0, pose_at(deepest * static_cast<float>(tick) / kTicks));
    result.has_dropped |= (scene.tick().faults & step::kFaultContactLimit) != 0;
    forces = {forces[1], forces[2], static_cast<double>(scene.reaction(0).force_n.y)};
    if (tick <= kTicks / 2) continue;
    result.mean_n += forces[2] / (kTicks / 2);
    result.largest_jump_n =
        std::max(result.largest_jump_n, std::abs(forces[2] - 2 * forces[1] + forces[0]));
  }
  result.left_behind_m = length(scene.proxy(0).pose.position - pose_at(deepest).position);
  return result;
}

void expect_steady_and_alike(const organ::Organ& organ, Side side) {
  const auto thin = press(organ, side, 0.002f), thick = press(organ, side, 0.004f);
  std::printf("2 mm: %.3f N, largest jump %.2f %%; 4 mm: %.3f N, %.2f %%\n", thin.mean_n,
              100 * thin.largest_jump_n / thin.mean_n, thick.mean_n,
              100 * thick.largest_jump_n / thick.mean_n);
  for (const auto& blade : {thin, thick}) {
    EXPECT_FALSE(blade.has_dropped);
    EXPECT_LT(blade.largest_jump_n, 0.01 * blade.mean_n);
    EXPECT_LT(blade.left_behind_m, 0.001f);
  }
  EXPECT_GT(thin.mean_n, 0.1);
  EXPECT_NEAR(thin.mean_n, thick.mean_n, 0.1 * thick.mean_n);
}

TEST(Blade, OnItsFlatSidePressesAsAThickerOne) {
  expect_steady_and_alike(*catalogue::make_liver(), Side::Flat);
}

TEST(Blade, OnItsEdgePressesAsAThickerOne) {
  expect_steady_and_alike(*catalogue::make_liver(), Side::Edge);
}

TEST(Blade, OnItsFlatSidePressesAsAThickerOneOnARefinedMesh) {
  expect_steady_and_alike(*catalogue::make_liver(45'000), Side::Flat);
}

TEST(Blade, OnItsEdgePressesAsAThickerOneOnARefinedMesh) {
  expect_steady_and_alike(*catalogue::make_liver(45'000), Side::Edge);
}

}  // namespace
}  // namespace trocar::contact::testing
