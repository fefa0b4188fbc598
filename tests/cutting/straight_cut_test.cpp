// Boxes: through, along lattice nodes, crossing, curved, in tissue that has moved, and how much of
// it is done at a time.

#include <gtest/gtest.h>

#include <cmath>

#include "tests/cutting/cut_organ.h"

namespace trocar::cutting::testing {
namespace {

constexpr double kSide = 0.08;

// In the plane x = const, all through an 80 mm box.
Path through_x(double x, double step_m = 0.0005) {
  return straight_path({{x, -0.06, -0.06}, {x, -0.06, 0.06}}, {{x, 0.06, -0.06}, {x, 0.06, 0.06}},
                       step_m);
}
CutOrgan regular_box() {
  return CutOrgan(box_organ(8, 8, 8, 0.01, 0));
}

TEST(StraightCut, PartsABoxInTwo) {
  CutOrgan box(box_organ(8, 8, 8, 0.01));
  box.stroke(through_x(0.003));
  EXPECT_EQ(box.check(), "");
  EXPECT_EQ(find_pieces(box.topology()).count, 2u);
  EXPECT_NEAR(box.total().opened_area_m2, kSide * kSide, 0.04 * kSide * kSide);
  EXPECT_EQ(box.total().waiting_area_m2, 0);
}

TEST(StraightCut, StaysValidAfterEveryTick) {
  CutOrgan box(box_organ(4, 4, 4, 0.02));
  for (const auto& edge : through_x(0.003, 0.003)) {
    ASSERT_TRUE(box.cutter().move(0, edge));
    box.tick();
    ASSERT_EQ(box.check(), "");
  }
}

TEST(StraightCut, FollowsTheBlade) {
  CutOrgan box(box_organ(8, 8, 8, 0.01));
  const auto path = through_x(0.003);
  for (std::size_t i = 0; i < path.size(); ++i) {
    ASSERT_TRUE(box.cutter().move(0, path[i]));
    box.tick();
    const double depth = path[i][0].y + kSide / 2;  // of the blade in the box
    const double wound = box.total().opened_area_m2 / kSide;
    EXPECT_LE(wound, std::max(0.0, depth + 0.012));
    EXPECT_GE(wound, std::min(depth, kSide) - 0.012);
  }
}

TEST(StraightCut, SpeedChangesLittle) {
  for (const double step : {0.0001, 0.001, 0.005, 0.03}) {
    CutOrgan box(box_organ(8, 8, 8, 0.01));
    box.stroke(through_x(0.003, step));
    EXPECT_EQ(box.check(), "") << step;
    EXPECT_EQ(find_pieces(box.topology()).count, 2u) << step;
    EXPECT_NEAR(box.total().opened_area_m2, kSide * kSide, 0.05 * kSide * kSide) << step;
  }
}

TEST(StraightCut, AlongFacesOfTheLatticeNeedsNoSplit) {
  auto box = regular_box();
  box.stroke(through_x(0.01));
  EXPECT_EQ(box.check(), "");
  EXPECT_EQ(find_pieces(box.topology()).count, 2u);
  EXPECT_EQ(box.total().splits, 0u);
  EXPECT_NEAR(box.total().opened_area_m2, kSide * kSide, 1e-9);
}

TEST(StraightCut, ThroughNodesAndAlongEdgesOfTheLattice) {
  auto box = regular_box();
  // Diagonal planes: through the diagonals of cells, and through corners only.
  const Vec3d normals[] = {{1, 1, 0}, {0, 1, -1}, {1, 1, 1}, {2, 1, 0}};
  for (const auto& normal : normals) {
    const Vec3d n = normalized(normal, {});
    const Vec3d e = normalized(cross(n, Vec3d{0.3, 0.1, 1}), {}), m = cross(n, e);
    box.stroke(
        straight_path({(e + m) * -0.1, (e - m) * 0.1}, {(m - e) * 0.1, (e + m) * 0.1}, 1e-3));
    ASSERT_EQ(box.check(), "");
  }
  EXPECT_GE(find_pieces(box.topology()).count, 6u);
}

TEST(StraightCut, CrossingCutsMakeEightPieces) {
  CutOrgan box(box_organ(8, 8, 8, 0.01));
  box.stroke(through_x(0.003));
  box.stroke(straight_path({{-0.06, 0.002, -0.06}, {-0.06, 0.002, 0.06}},
                           {{0.06, 0.002, -0.06}, {0.06, 0.002, 0.06}}, 0.0007));
  ASSERT_EQ(box.check(), "");
  EXPECT_EQ(find_pieces(box.topology()).count, 4u);
  box.stroke(straight_path({{-0.06, -0.06, 0.001}, {-0.06, 0.06, 0.001}},
                           {{0.06, -0.06, 0.001}, {0.06, 0.06, 0.001}}, 0.0007));
  EXPECT_EQ(box.check(), "");
  EXPECT_EQ(find_pieces(box.topology()).count, 8u);
  EXPECT_NEAR(box.total().opened_area_m2, 3 * kSide * kSide, 0.05 * 3 * kSide * kSide);
}

TEST(StraightCut, CurvedCutTakesACornerOff) {
  CutOrgan box(box_organ(8, 8, 8, 0.01));
  Path path;  // a quarter of a cylinder, 50 mm about the corner's edge, and a little beyond
  for (double angle = -0.15; angle < M_PI / 2 + 0.15; angle += 0.01) {
    const double x = 0.04 - 0.05 * std::cos(angle), y = 0.04 - 0.05 * std::sin(angle);
    path.push_back({{x, y, -0.05}, {x, y, 0.05}});
  }
  box.stroke(path);
  EXPECT_EQ(box.check(), "");
  EXPECT_EQ(find_pieces(box.topology()).count, 2u);
  const double area = 0.05 * M_PI / 2 * kSide;
  EXPECT_NEAR(box.total().opened_area_m2, area, 0.06 * area);
}

TEST(StraightCut, TwoBladesMeetInTheMiddle) {
  CutOrgan box(box_organ(8, 8, 8, 0.01));
  const auto up = through_x(0.003), down = straight_path(up.back(), up.front(), 0.0005);
  for (std::size_t i = 0; i < up.size(); ++i) {
    ASSERT_TRUE(box.cutter().move(3, up[i]));
    ASSERT_TRUE(box.cutter().move(5, down[i]));
    box.tick();
  }
  EXPECT_EQ(box.check(), "");
  box.cutter().lift(3);
  box.cutter().lift(5);
  box.run_until_idle();
  EXPECT_EQ(box.check(), "");
  EXPECT_EQ(find_pieces(box.topology()).count, 2u);
}

// A blade cuts tissue where it is now: a straight cut through a sheared box is oblique at rest.
TEST(StraightCut, MeetsTissueWhereItIs) {
  CutOrgan box(box_organ(8, 8, 8, 0.01));
  for (const auto& p : box.organ().mesh.rest_positions)
    box.displacements.push_back(to_float(Vec3d{0.5 * p.y, 0, 0}));
  box.stroke(through_x(0.003));
  EXPECT_EQ(box.check(), "");
  EXPECT_EQ(find_pieces(box.topology()).count, 2u);
  const double area = kSide * kSide * std::sqrt(1.25);
  EXPECT_NEAR(box.total().opened_area_m2, area, 0.05 * area);
}

// Tissue sways by more than h while it is cut; what is cut is where it is at each tick.
TEST(StraightCut, FollowsTissueThatMoves) {
  CutOrgan box(box_organ(8, 8, 8, 0.01));
  const auto path = through_x(0.003);
  for (std::size_t tick = 0; tick < path.size(); ++tick) {
    const double sway = std::sin(0.03 * static_cast<double>(tick));
    box.displacements.clear();
    for (const auto& p : box.topology().rest())
      box.displacements.push_back(to_float(Vec3d{0.0, 0.1 * p.z * sway, 0.2 * p.y * sway}));
    ASSERT_TRUE(box.cutter().move(0, path[tick]));
    box.tick();
    if (tick % 40 == 0) {
      ASSERT_EQ(box.check(), "") << tick;
    }
  }
  box.cutter().lift(0);
  box.run_until_idle();
  EXPECT_EQ(box.check(), "");
  EXPECT_EQ(find_pieces(box.topology()).count, 2u);
  EXPECT_NEAR(box.total().opened_area_m2, kSide * kSide, 0.05 * kSide * kSide);
}

TEST(StraightCut, KeepsMaterialsAndStressFreeShape) {
  auto organ = box_organ(6, 6, 6, 0.01);
  auto heavy = organ.material;
  heavy.density_kg_m3 *= 3;
  std::vector<NodeIndex> half;
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
    if (organ.mesh.rest_positions[n].y > -1e-3) half.emplace_back(n);
  organ.regions = {{"heavy", heavy, half}};
  for (const auto& p : organ.mesh.rest_positions)
    organ.stress_free_positions_m.push_back({p.x * 1.1, p.y, p.z * 0.9});
  CutOrgan box(std::move(organ));
  box.stroke(through_x(0.003, 0.001));
  EXPECT_EQ(box.check(), "");
  EXPECT_EQ(find_pieces(box.topology()).count, 2u);
}

TEST(StraightCut, WorkIsBoundedAndNothingIsLost) {
  Settings settings;
  settings.edits_per_call = 20;
  CutOrgan box(box_organ(8, 8, 8, 0.01), settings);
  std::uint32_t most = 0, calls_behind = 0;
  const auto count = [&] {
    const auto before = box.total().splits + box.total().labels;
    box.tick();
    most = std::max(most, box.total().splits + box.total().labels - before);
    calls_behind += box.total().is_behind;
  };
  for (const auto& edge : through_x(0.003, 0.01)) {
    ASSERT_TRUE(box.cutter().move(0, edge));
    count();
  }
  box.cutter().lift(0);
  while (!box.cutter().is_idle()) count();
  EXPECT_EQ(box.check(), "");
  EXPECT_LE(most, 20u);
  EXPECT_GT(calls_behind, 10u);
  EXPECT_EQ(find_pieces(box.topology()).count, 2u);
}

// The cutter and a copy of the topology both reuse the places of a removed corner first.
TEST(StraightCut, UsesUnusedPlacesFirst) {
  const auto organ = box_organ(4, 4, 4, 0.01);
  topology::Topology topology(organ), copy(organ);
  Cutter cutter(topology);
  const auto remove_corner = [](topology::Topology& from, Places& places) {
    const NodeIndex corner(0u);
    const auto at = from.tets_of(corner);
    for (const auto tet : std::vector<TetIndex>(at.begin(), at.end())) {
      from.remove_tet(tet);
      places.release(tet);
    }
    from.remove_node(corner);
    places.release(corner);
  };
  remove_corner(topology, cutter.places());
  Places places(copy);
  remove_corner(copy, places);
  const auto before = topology.tet_count();
  CutOutput out;
  std::uint32_t splits = 0;
  for (const auto& edge : through_x(0.003, 0.002)) {
    ASSERT_TRUE(cutter.move(0, edge));
    cutter.cut({}, out);
    splits += out.splits;
    ASSERT_TRUE(apply(out.events, copy, places).ok());
  }
  EXPECT_GT(splits, 0u);
  EXPECT_TRUE(topology.has_node(NodeIndex(0u)));
  EXPECT_GT(topology.tet_count(), before);
  EXPECT_TRUE(validate(topology).ok());
  EXPECT_EQ(topology_hash(topology), topology_hash(copy));
}

TEST(StraightCut, SameInputSameTopology) {
  std::uint64_t hashes[2];
  for (auto& hash : hashes) {
    CutOrgan box(box_organ(6, 6, 6, 0.01));
    box.stroke(through_x(0.003, 0.0013));
    hash = topology_hash(box.topology());
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

}  // namespace
}  // namespace trocar::cutting::testing
