// How much of a blade tissue lies against.

#include "server/tissue/cutting/blade_friction.h"

#include <gtest/gtest.h>

#include "tests/cutting/cut_organ.h"

namespace trocar::cutting::testing {
namespace {

constexpr double kTau_pa = 1500, kNear_m = 0.0005;

// Returns a cube 4 cm wide, from -2 to 2 cm along each axis.
organ::Organ box(double jitter = 0.2) {
  auto organ = box_organ(4, 4, 4, 0.01, jitter);
  organ.material.blade_friction_pa = kTau_pa;
  return organ;
}

double friction(CutOrgan& organ, const Vec3d& from, const Vec3d& to) {
  return organ.cutter().friction_along(organ.displacements, kUnknownTravel, from, to);
}

TEST(BladeFriction, IsOfTheLengthInTissue) {
  CutOrgan organ(box());
  const auto expect = [&](double length, const Vec3d& from, const Vec3d& to) {
    EXPECT_NEAR(friction(organ, from, to), kTau_pa * length, kTau_pa * 1e-9);
  };
  expect(0.04 + 2 * kNear_m, {0.003, -0.05, 0.004}, {0.003, 0.05, 0.004});
  expect(0.03 + kNear_m, {0.003, -0.01, 0.004}, {0.003, 0.05, 0.004});
  expect(0.02, {0.003, 0.01, 0.004}, {0.003, -0.01, 0.004});
  expect(0.012, {-0.004, 0.001, -0.013}, {-0.004, 0.001, -0.001});
  expect(0, {0.021, -0.05, 0.004}, {0.021, 0.05, 0.004});
  expect(0, {0.003, 0.03, 0.004}, {0.003, 0.05, 0.004});
}

TEST(BladeFriction, MovesWithTheTissueAndChangesWithoutSteps) {
  CutOrgan organ(box());
  organ.displacements.assign(organ.topology().node_count(), Vec3f{0.1f, 0, 0});
  EXPECT_EQ(friction(organ, {0, -0.05, 0}, {0, 0.05, 0}), 0);
  double last = 0, most = 0;
  for (int i = 0; i <= 1000; ++i) {
    const double depth = -0.01 + 6e-5 * i;  // from above the box to below it
    const double now = friction(organ, {0.101, 0.02 - depth, 0.004}, {0.101, 0.12 - depth, 0.004});
    EXPECT_LE(std::abs(now - last), kTau_pa * 6.1e-5);
    last = now;
    most = std::max(most, now);
  }
  EXPECT_NEAR(most, kTau_pa * (0.04 + 2 * kNear_m), 1e-6);
}

TEST(BladeFriction, IsOfTheMaterialsOnTheWay) {
  auto organ = box(0);
  auto smooth = organ.material;
  smooth.blade_friction_pa = 100;
  std::vector<NodeIndex> upper;
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
    if (organ.mesh.rest_positions[n].y > -1e-6) upper.emplace_back(n);
  organ.regions = {{"upper", smooth, upper}};
  CutOrgan cut(organ);
  EXPECT_NEAR(friction(cut, {0.003, -0.05, 0.004}, {0.003, 0.05, 0.004}),
              kTau_pa * 0.02 + smooth.blade_friction_pa * 0.02, kTau_pa * 3 * kNear_m);
}

TEST(BladeFriction, IsNothingInAWoundThatGapes) {
  CutOrgan organ(box(0));
  organ.stroke(straight_path({{0.0005, -0.05, -0.06}, {0.0005, -0.05, 0.06}},
                             {{0.0005, 0.05, -0.06}, {0.0005, 0.05, 0.06}}, 0.002));
  ASSERT_EQ(organ.check(), "");
  ASSERT_EQ(find_pieces(organ.topology()).count, 2u);
  const Vec3d from{0.0005, -0.05, 0.004}, to{0.0005, 0.05, 0.004};
  EXPECT_NEAR(friction(organ, from, to), kTau_pa * (0.04 + 2 * kNear_m), kTau_pa * 1e-3);
  const auto pieces = find_pieces(organ.topology());
  organ.displacements.resize(organ.topology().node_count());
  for (std::uint32_t n = 0; n < organ.displacements.size(); ++n) {
    const auto tets = organ.topology().tets_of(NodeIndex(n));
    if (tets.empty()) continue;
    double x = 0;
    for (const auto t : tets)
      for (const auto node : organ.topology().tet(t)) x += organ.topology().rest()[node.value].x;
    organ.displacements[n].x = x < 0 ? -0.01f : 0.01f;
  }
  EXPECT_EQ(friction(organ, from, to), 0);
}

// The cutter looks for tissue near the blade in each call and remembers none, so the friction is
// the same with any count of travel.
TEST(BladeFriction, RefusesWhatIsNoBladeAndForgetsNothing) {
  CutOrgan organ(box());
  EXPECT_EQ(friction(organ, {0, 0, 0}, {0, 0, 0}), 0);
  EXPECT_EQ(friction(organ, {0, std::nan(""), 0}, {0, 0, 0.1}), 0);
  EXPECT_EQ(friction(organ, {0, -1e30, 0}, {0, 1e30, 0}), 0);
  trocar::testing::Random random(3);
  const auto any = [&] { return random.between(-0.03, 0.03); };
  for (int i = 0; i < 200; ++i) {
    const Vec3d from{any(), any(), any()}, to{any(), any(), any()};
    const double first = friction(organ, from, to);
    EXPECT_EQ(organ.cutter().friction_along({}, 0, from, to), first);
    EXPECT_NEAR(friction(organ, to, from), first, kTau_pa * 1e-9);
    EXPECT_LE(first, kTau_pa * length(to - from) * (1 + 1e-12));
  }
}

}  // namespace
}  // namespace trocar::cutting::testing
