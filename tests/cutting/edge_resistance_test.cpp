// Tests what the edge of a blade meets in tissue.

#include "server/tissue/cutting/edge_resistance.h"

#include <gtest/gtest.h>

#include <numeric>

#include "tests/cutting/cut_organ.h"
#include "tests/support/random.h"

namespace trocar::cutting::testing {
namespace {

constexpr double kTau_pa = 1500, kNear_m = 0.00125;
// Tissue beside an end of the edge counts for half of the way to kNear_m.
constexpr double kEnd_m = kNear_m / 2;

double sum(const std::array<double, kEdgeParts>& parts) {
  return std::accumulate(parts.begin(), parts.end(), 0.0);
}

// Returns a cube 4 cm wide, from -2 to 2 cm along each axis.
organ::Organ box(double jitter = 0.2) {
  auto organ = box_organ(4, 4, 4, 0.01, jitter);
  organ.material.blade_friction_pa = kTau_pa;
  return organ;
}

EdgeResistance look(CutOrgan& organ, const Vec3d& from, const Vec3d& to) {
  return organ.cutter().resistance_of(organ.displacements, {}, kUnknownTravel, from, to);
}
double friction(CutOrgan& organ, const Vec3d& from, const Vec3d& to) {
  return sum(look(organ, from, to).friction_n_m);
}
// The edge is looked at in so many places, each for the way to the next.
double spacing(const Vec3d& from, const Vec3d& to) {
  return length(to - from) / (kEdgeParts * kEdgeSamples);
}

TEST(EdgeResistance, IsOfTheLengthInTissue) {
  CutOrgan organ(box());
  const auto expect = [&](double length, const Vec3d& from, const Vec3d& to) {
    EXPECT_NEAR(friction(organ, from, to), kTau_pa * length, kTau_pa * spacing(from, to));
  };
  expect(0.04 + 2 * kEnd_m, {0.003, -0.05, 0.004}, {0.003, 0.05, 0.004});
  expect(0.03 + kEnd_m, {0.003, -0.01, 0.004}, {0.003, 0.05, 0.004});
  expect(0.02, {0.003, 0.01, 0.004}, {0.003, -0.01, 0.004});
  expect(0.012, {-0.004, 0.001, -0.013}, {-0.004, 0.001, -0.001});
  expect(0.04 * 0.2, {0.021, -0.02, 0.004}, {0.021, 0.02, 0.004});
  expect(0, {0.0213, -0.05, 0.004}, {0.0213, 0.05, 0.004});
  expect(0, {0.003, 0.03, 0.004}, {0.003, 0.05, 0.004});
}

TEST(EdgeResistance, SaysHowTheTissueMoves) {
  CutOrgan organ(box());
  const Vec3d from{0.003, -0.03, 0.004}, to{0.003, 0.03, 0.004};
  const auto velocity_at = [](const Vec3d& p) { return Vec3d{0.02 + 0.5 * p.y, 0.3 * p.x, 0}; };
  std::vector<Vec3f> velocities;
  for (const auto& rest : organ.topology().rest())
    velocities.push_back(to_float(velocity_at(rest)));
  const auto tissue_m_s =
      organ.cutter().resistance_of({}, velocities, kUnknownTravel, from, to).tissue_m_s;
  constexpr double kSlopeError = 0.02;
  EXPECT_LT(length(tissue_m_s[0] - velocity_at(from)), kSlopeError * 0.5 * 0.03);
  EXPECT_LT(length(tissue_m_s[1] - velocity_at(to)), kSlopeError * 0.5 * 0.03);
  EXPECT_EQ(look(organ, from, to).tissue_m_s, (std::array<Vec3d, 2>{}));
}

// It is the motion of the edge in the tissue that cuts: a blade that is held still while the tissue
// is drawn past it, and one that moves with the tissue.
TEST(ABladeHeldStill, CutsWhatIsDrawnPastIt) {
  const Edge edge{{-0.03, 0.003, -0.03}, {-0.03, 0.003, 0.03}};
  constexpr int kTicks = 600;
  constexpr double kStep_m = 1e-4;
  CutOrgan moves(box()), stands(box());
  const auto node_count = stands.topology().node_count();
  for (int i = 0; i <= kTicks; ++i) {
    const Vec3d way{i * kStep_m, 0, 0};
    moves.cutter().move(0, Edge{edge[0] + way, edge[1] + way});
    moves.tick();
    stands.displacements.assign(stands.topology().node_count(), to_float(-way));
    if (i > 0) stands.cutter().carry(0, {Vec3d{-kStep_m, 0, 0}, Vec3d{-kStep_m, 0, 0}});
    stands.cutter().move(0, edge);
    stands.tick();
  }
  for (auto* const organ : {&moves, &stands}) {
    organ->cutter().lift(0);
    organ->run_until_idle();
    EXPECT_EQ(organ->check(), "");
    EXPECT_NEAR(organ->total().opened_area_m2, 0.04 * 0.04, 0.04 * 0.04 * 0.1);
    EXPECT_GT(organ->topology().node_count(), node_count);
  }
  EXPECT_NEAR(stands.total().opened_area_m2, moves.total().opened_area_m2,
              0.01 * moves.total().opened_area_m2);
}

// A point that goes in along its own edge sweeps nothing, however the tissue trembles.
TEST(ABladeHeldStill, CutsNothingWhereItSlidesAlongItsEdge) {
  CutOrgan organ(box());
  trocar::testing::Random random(7);
  for (int i = 0; i <= 600; ++i) {
    const Vec3d tip{0.003, 0.03 - 1e-4 * i, 0.004};
    const auto tremble = [&] { return Vec3d{1, 0, 0.5} * random.between(-2e-7, 2e-7); };
    if (i > 0) organ.cutter().carry(0, {tremble(), tremble()});
    organ.cutter().move(0, Edge{tip, tip + Vec3d{0, 0.04, 0}});
    organ.tick();
  }
  organ.cutter().lift(0);
  organ.run_until_idle();
  EXPECT_EQ(organ.total().splits, 0u);
  EXPECT_EQ(organ.total().opened_area_m2, 0);
}

TEST(ABladeHeldStill, CutsNothingThatItMovesWith) {
  CutOrgan organ(box());
  const Edge edge{{-0.001, 0.003, -0.03}, {-0.001, 0.003, 0.03}};
  const Vec3d step{1e-4, 0, 0};
  for (int i = 0; i <= 100; ++i) {
    const Vec3d way = step * i;
    organ.displacements.assign(organ.topology().node_count(), to_float(way));
    if (i > 0) organ.cutter().carry(0, {step, step});
    organ.cutter().move(0, Edge{edge[0] + way, edge[1] + way});
    organ.tick();
  }
  organ.cutter().lift(0);
  organ.run_until_idle();
  EXPECT_EQ(organ.total().splits, 0u);
  EXPECT_EQ(organ.total().opened_area_m2, 0);
}

TEST(EdgeResistance, SaysWhichPartsMeetIt) {
  auto organ = box();
  organ.material.cut_energy_j_m2 = 100;
  CutOrgan cut(organ);
  const auto met = look(cut, {0.003, -0.01, 0.004}, {0.003, 0.07, 0.004});
  for (const std::size_t i : {0, 1, 2}) {
    EXPECT_NEAR(met.cut_n[i], 100 * 0.01, 1e-9);
    EXPECT_NEAR(met.friction_n_m[i], kTau_pa * 0.01, 1e-9);
  }
  for (const std::size_t i : {4, 5, 6, 7}) EXPECT_EQ(met.cut_n[i], 0);
  EXPECT_EQ(met.whole_cut_n, sum(met.cut_n));
}

TEST(EdgeResistance, MovesWithTheTissueAndChangesWithoutSteps) {
  CutOrgan organ(box());
  organ.displacements.assign(organ.topology().node_count(), Vec3f{0.1f, 0, 0});
  EXPECT_EQ(friction(organ, {0, -0.05, 0}, {0, 0.05, 0}), 0);
  double last = 0, most = 0;
  const double spaced = 0.1 / (kEdgeParts * kEdgeSamples);
  for (int i = 0; i <= 1000; ++i) {
    const double depth = -0.01 + 6e-5 * i;  // from above the box to below it
    const double now = friction(organ, {0.101, 0.02 - depth, 0.004}, {0.101, 0.12 - depth, 0.004});
    // At most two of the places come nearer to the surface at once.
    EXPECT_LE(std::abs(now - last), kTau_pa * 6.1e-5 * 2 * spaced / kNear_m);
    last = now;
    most = std::max(most, now);
  }
  EXPECT_NEAR(most, kTau_pa * (0.04 + 2 * kEnd_m), kTau_pa * spaced);
}

// It fades in and out where the whole edge comes to a flat side at once.
TEST(EdgeResistance, FadesBesideTissue) {
  CutOrgan organ(box());
  double last = kTau_pa * 0.02;
  for (int i = -10; i <= 200; ++i) {
    const double x = 0.02 + 1e-5 * i;
    const double now = friction(organ, {x, -0.01, 0.003}, {x, 0.01, 0.003});
    EXPECT_NEAR(now, kTau_pa * 0.02 * std::clamp(1 - (x - 0.02) / kNear_m, 0.0, 1.0), 1e-9);
    EXPECT_LE(now, last + 1e-12);
    last = now;
  }
}

TEST(EdgeResistance, IsOfTheMaterialsOnTheWay) {
  auto organ = box(0);
  auto smooth = organ.material;
  smooth.blade_friction_pa = 100;
  std::vector<NodeIndex> upper;
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
    if (organ.mesh.rest_positions[n].y > -1e-6) upper.emplace_back(n);
  organ.regions = {{"upper", smooth, upper}};
  CutOrgan cut(organ);
  EXPECT_NEAR(friction(cut, {0.003, -0.05, 0.004}, {0.003, 0.05, 0.004}),
              kTau_pa * 0.02 + smooth.blade_friction_pa * 0.02, kTau_pa * 2 * kNear_m);
}

TEST(EdgeResistance, IsNothingInAWoundThatGapes) {
  CutOrgan organ(box(0));
  organ.stroke(straight_path({{0.0005, -0.05, -0.06}, {0.0005, -0.05, 0.06}},
                             {{0.0005, 0.05, -0.06}, {0.0005, 0.05, 0.06}}, 0.002));
  ASSERT_EQ(organ.check(), "");
  ASSERT_EQ(find_pieces(organ.topology()).count, 2u);
  const Vec3d from{0.0005, -0.05, 0.004}, to{0.0005, 0.05, 0.004};
  EXPECT_NEAR(friction(organ, from, to), kTau_pa * (0.04 + 2 * kEnd_m),
              kTau_pa * spacing(from, to));
  const auto met = look(organ, from, to);
  EXPECT_LT(met.whole_cut_n, 0.1 * sum(met.cut_n)) << "it lies in the wound";
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
TEST(EdgeResistance, RefusesWhatIsNoBladeAndForgetsNothing) {
  CutOrgan organ(box());
  EXPECT_EQ(friction(organ, {0, 0, 0}, {0, 0, 0}), 0);
  EXPECT_EQ(friction(organ, {0, std::nan(""), 0}, {0, 0, 0.1}), 0);
  EXPECT_EQ(friction(organ, {0, -1e30, 0}, {0, 1e30, 0}), 0);
  trocar::testing::Random random(3);
  const auto any = [&] { return random.between(-0.03, 0.03); };
  for (int i = 0; i < 200; ++i) {
    const Vec3d from{any(), any(), any()}, to{any(), any(), any()};
    const double first = friction(organ, from, to);
    EXPECT_EQ(sum(organ.cutter().resistance_of({}, {}, 0, from, to).friction_n_m), first);
    EXPECT_NEAR(friction(organ, to, from), first, kTau_pa * 1e-9);
    EXPECT_LE(first, kTau_pa * length(to - from) * (1 + 1e-12));
  }
}

}  // namespace
}  // namespace trocar::cutting::testing
