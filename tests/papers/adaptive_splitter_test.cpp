// The paper's own method: Nakao 2003 sec. 3.3.

#include <gtest/gtest.h>

#include <array>
#include <sstream>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/papers/nakao/adaptive_splitter.h"
#include "server/tissue/cutting/event_codec.h"
#include "tests/cutting/cut_organ.h"

namespace trocar::cutting::testing {
namespace {

using nakao::settings_of;
using nakao::Variant;

std::uint32_t tets(const dynamics::Topology& topology) {
  std::uint32_t count = 0;
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t) count += topology.has_tet(TetIndex(t));
  return count;
}

TEST(Nakao, ATetBecomesFourOrSix) {
  for (const auto method : {Variant::Adaptive, Variant::Plain}) {
    CutOrgan tet(tet_organ(), settings_of(method));
    const Vec3d from{0.02, -0.2, -0.2}, to{0.02, -0.2, 0.2}, up{0.001, 0.4, 0.002};
    tet.stroke({{from, to}, {from + up, to + up}});
    EXPECT_EQ(tet.check(), "");
    EXPECT_EQ(tet.total().six_tets, 1u);
    EXPECT_EQ(tet.total().other_tets, 0u);
    EXPECT_EQ(tets(tet.topology()), 6u);
    EXPECT_EQ(find_pieces(tet.topology()).count, 2u);
  }
  CutOrgan tet(tet_organ(), settings_of(Variant::Adaptive));
  const Vec3d middle = Vec3d{1, 1, 1} * 0.02, u{0.15, -0.15, 0}, v{0.1, 0.1, -0.2};
  tet.stroke({{middle - u - v, middle + u - v}, {middle - u + v, middle + u + v}});
  EXPECT_EQ(tet.check(), "");
  EXPECT_EQ(tet.total().four_tets, 1u);
  EXPECT_EQ(tets(tet.topology()), 4u);
}

TEST(Nakao, AChosenPatternIsNoWorseThanAnyOther) {
  trocar::testing::Random random(1);
  for (int i = 0; i < 200; ++i) {
    const auto organ = box_organ(1, 1, 1, 0.01, 0, 1);
    const dynamics::Topology start(organ);
    // Edges from the middle tet's first corner, or those between two of its pairs.
    const auto tet = start.tet(TetIndex(4u));
    const bool is_three = i % 2 == 0;
    std::vector<EdgeCut> cuts;
    for (const auto& [p, q] :
         is_three ? std::vector<std::array<std::size_t, 2>>{{0, 1}, {0, 2}, {0, 3}}
                  : std::vector<std::array<std::size_t, 2>>{{0, 1}, {0, 2}, {3, 1}, {3, 2}}) {
      const auto [a, b] = std::minmax(tet[p], tet[q]);
      const auto t = static_cast<std::uint16_t>(6000 + random.below(53000));
      cuts.push_back({a, b, t, along(start.rest()[a.value], start.rest()[b.value], t)});
    }
    std::sort(cuts.begin(), cuts.end(), [](const EdgeCut& x, const EdgeCut& y) {
      return std::tie(x.a, x.b) < std::tie(y.a, y.b);
    });
    // Sum over the cut tets of the worst sine in each.
    const auto score = [&](std::span<const std::uint32_t> order) {
      dynamics::Topology topology(organ);
      Places places(topology);
      std::vector<TetChild> children;
      std::vector<std::uint32_t> origin(topology.tet_count());
      for (std::uint32_t t = 0; t < origin.size(); ++t) origin[t] = t;
      for (const auto c : order) {
        split_edge(topology, places, cuts[c].a, cuts[c].b, cuts[c].t, children);
        origin.resize(topology.tet_count());
        for (const auto& [parent, child] : children) origin[child.value] = origin[parent.value];
      }
      EXPECT_TRUE(validate(topology));
      std::array<double, 5> least;
      least.fill(1);
      for (std::uint32_t t = 0; t < topology.tet_count(); ++t)
        least[origin[t]] = std::min(least[origin[t]],
                                    least_sine(rest_corners(topology, topology.tet(TetIndex(t)))));
      double sum = 0;
      for (const double sine : least) sum += sine;
      return sum;
    };
    Subdivision subdivision;
    const auto chosen = subdivision.order(start, cuts);
    const double own = score(chosen);
    std::vector<std::uint32_t> order(cuts.size());
    for (std::uint32_t c = 0; c < order.size(); ++c) order[c] = c;
    do {
      EXPECT_GE(own, score(order) - 1e-9) << i;
    } while (std::next_permutation(order.begin(), order.end()));
  }
}

struct Tally {
  std::uint32_t cut_tets = 0, patterns = 0, moved = 0, refused = 0, smoothed = 0;
  double opened_m2 = 0, waiting_m2 = 0, least_sine = 1;

  void add(const CutOrgan& organ) {
    const auto& total = organ.total();
    cut_tets += total.crossed_tets;
    patterns += total.four_tets + total.six_tets;
    moved += total.moved_nodes;
    refused += total.refused_moves;
    smoothed += total.smoothed_nodes;
    opened_m2 += total.opened_area_m2;
    waiting_m2 += total.waiting_area_m2;
    least_sine = std::min(least_sine, least_dihedral_sine(organ.topology()));
  }
  std::string text() const {
    std::ostringstream out;
    out << cut_tets << " tets cut, " << patterns << " as 1+3 or 2+2; nodes moved " << moved
        << ", refused " << refused << ", smoothed " << smoothed << "; opened " << opened_m2
        << " m2, left closed " << waiting_m2 << " m2; least sine " << least_sine;
    return out.str();
  }
};

// A cut through the plate's thickness that begins and ends inside.
Path plate_path(trocar::testing::Random& random, double step_m) {
  const Vec3d middle{random.between(-0.02, 0.02), 0, random.between(-0.02, 0.02)};
  Vec3d along{random.between(-1, 1), 0, random.between(-1, 1)};
  along = normalized(along, Vec3d{1, 0, 0}) * random.between(0.01, 0.05);
  const Vec3d down{random.between(-0.003, 0.003), 0.006, random.between(-0.003, 0.003)};
  return straight_path({middle - along - down, middle - along + down},
                       {middle + along - down, middle + along + down}, step_m);
}
// Into a block from outside, to somewhere inside.
Path block_path(trocar::testing::Random& random, double step_m) {
  const Vec3d tip{random.between(-0.02, 0.02), random.between(-0.02, 0.02), 0.06};
  const Vec3d deep = tip - Vec3d{0, 0, random.between(0.04, 0.09)};
  Vec3d along{random.between(-1, 1), random.between(-1, 1), random.between(-0.3, 0.3)};
  along = normalized(along, Vec3d{1, 0, 0}) * random.between(0.01, 0.04);
  return straight_path({tip - along, deep - along}, {tip + along, deep + along}, step_m);
}

TEST(Nakao, RandomStraightCutsLeaveASoundSolid) {
  const auto plate = catalogue::make_plate();
  const auto block = box_organ(6, 6, 6, 0.012);
  for (const auto method : {Variant::Adaptive, Variant::Plain})
    for (const double piece_h : {1e3, 1.0}) {
      trocar::testing::Random random(3);
      Tally on_plate, on_block;
      for (int i = 0; i < 30; ++i) {
        CutOrgan organ(plate, settings_of(method, piece_h));
        organ.stroke(plate_path(random, 0.005));
        ASSERT_EQ(organ.check(), "") << "plate " << i;
        EXPECT_GT(organ.total().opened_area_m2, 0) << i;
        on_plate.add(organ);
      }
      for (int i = 0; i < 30; ++i) {
        CutOrgan organ(block, settings_of(method, piece_h));
        organ.stroke(block_path(random, 0.005));
        ASSERT_EQ(organ.check(), "") << "block " << i;
        EXPECT_GT(organ.total().opened_area_m2, 0) << i;
        on_block.add(organ);
      }
      const std::string name = std::string(method == Variant::Adaptive ? "nakao" : "plain") +
                               (piece_h < 2 ? "_patches_of_an_edge" : "_one_patch");
      // Measured: at most 3 % of the area; a third of the nodes of a block, whose faces meet at
      // corners and whose tets are as large as the cut.
      EXPECT_LE(on_plate.waiting_m2 + on_block.waiting_m2,
                0.05 * (on_plate.opened_m2 + on_block.opened_m2));
      EXPECT_LE(on_plate.refused, 0.25 * (on_plate.moved + on_plate.refused));
      EXPECT_LE(on_block.refused, 0.40 * (on_block.moved + on_block.refused));
      RecordProperty(name + "_plate", on_plate.text());
      RecordProperty(name + "_block", on_block.text());
    }
}

// Crossing ones, on tissue that is not at rest.
TEST(Nakao, CutAfterCutOfADeformedBlock) {
  trocar::testing::Random random(4);
  for (int i = 0; i < 6; ++i) {
    CutOrgan organ(box_organ(5, 5, 5, 0.014), settings_of(Variant::Adaptive, 1));
    organ.displacements.resize(organ.topology().node_count());
    for (std::size_t n = 0; n < organ.displacements.size(); ++n) {
      const auto& p = organ.topology().rest()[n];
      organ.displacements[n] = to_float(Vec3d{0.1 * p.y, 0.05 * p.x + p.z * p.z, -0.08 * p.z});
    }
    for (int cut = 0; cut < 6; ++cut) {
      organ.stroke(block_path(random, 0.01));
      ASSERT_EQ(organ.check(), "") << i << ", cut " << cut;
    }
    EXPECT_GT(organ.total().opened_area_m2, 0);
  }
}

// An affine field stays what it is, whatever node moves in it.
TEST(Nakao, MovedNodesGoWithTheTissue) {
  CutOrgan organ(box_organ(6, 6, 6, 0.012), settings_of(Variant::Adaptive));
  const auto field = [](const Vec3d& p) {
    return Vec3d{0.1 * p.y - 0.02 * p.z, 0.05 * p.x, -0.08 * p.z + 0.03 * p.y};
  };
  organ.displacements.resize(organ.topology().node_count());
  for (std::size_t n = 0; n < organ.displacements.size(); ++n)
    organ.displacements[n] = to_float(field(organ.topology().rest()[n]));
  trocar::testing::Random random(5);
  for (int cut = 0; cut < 4; ++cut) organ.stroke(block_path(random, 0.01));
  ASSERT_EQ(organ.check(), "");
  EXPECT_GT(organ.total().moved_nodes + organ.total().smoothed_nodes, 0u);
  for (std::size_t n = 0; n < organ.displacements.size(); ++n)
    EXPECT_LT(length(to_double(organ.displacements[n]) - field(organ.topology().rest()[n])), 1e-7);
}

TEST(Nakao, MovesThatWouldBreakTheSolidAreRefused) {
  const auto organ = box_organ(2, 2, 2, 0.01, 0);
  dynamics::Topology topology(organ);
  const auto at = [&](const Vec3d& p) {
    for (std::uint32_t n = 0; n < topology.node_count(); ++n)
      if (length(topology.rest()[n] - p) < 1e-9) return NodeIndex(n);
    return NodeIndex();
  };
  const auto centre = at({0, 0, 0}), face = at({0, 0, 0.01}), edge = at({0, 0.01, 0.01}),
             corner = at({0.01, 0.01, 0.01});
  EXPECT_TRUE(can_move(topology, {centre, face, 20000}));
  EXPECT_FALSE(can_move(topology, {centre, face, 0}));
  EXPECT_FALSE(can_move(topology, {centre, face, 65535})) << "flat tets";
  EXPECT_FALSE(can_move(topology, {centre, centre, 20000}));
  EXPECT_FALSE(can_move(topology, {face, centre, 20000})) << "out of the surface";
  EXPECT_TRUE(can_move(topology, {face, edge, 20000})) << "in the surface";
  EXPECT_FALSE(can_move(topology, {edge, face, 20000}));
  EXPECT_TRUE(can_move(topology, {edge, corner, 20000})) << "along an edge of the solid";
  EXPECT_FALSE(can_move(topology, {corner, edge, 20000}));
  const CutEvents bad{{Move{face, centre, 20000}}, {}};
  Places places(topology);
  EXPECT_FALSE(apply(bad, topology, places));
  const CutEvents good{{Move{centre, face, 20000}}, {}};
  EXPECT_TRUE(apply(good, topology, places));
  EXPECT_TRUE(validate(topology));
  auto held = organ;
  held.fixed_nodes = {centre};
  EXPECT_FALSE(can_move(dynamics::Topology(held), {centre, face, 20000}));
}

// As of the other events: whatever is sent, it is refused or leaves as much solid as there was.
TEST(Nakao, ChangedHistoriesWithMovesBreakNoTopology) {
  const auto block = box_organ(4, 4, 4, 0.014);
  CutOrgan organ(block, settings_of(Variant::Adaptive));
  trocar::testing::Random random(6);
  for (int cut = 0; cut < 3; ++cut) organ.stroke(block_path(random, 0.01));
  ASSERT_EQ(organ.check(), "");
  ASSERT_GT(organ.total().moved_nodes, 0u);
  Bytes bytes;
  encode(organ.history(), bytes);
  EXPECT_EQ(decode(bytes), organ.history());
  const double volume = total_volume(organ.topology());
  std::uint32_t done = 0;
  for (int i = 0; i < 300; ++i) {
    auto changed = bytes;
    changed[random.below(static_cast<std::uint32_t>(changed.size()))] =
        static_cast<std::uint8_t>(random.below(256));
    const auto events = decode(changed);
    if (!events) continue;
    dynamics::Topology topology(block);
    Places places(topology);
    done += apply(*events, topology, places).ok();
    EXPECT_NEAR(total_volume(topology), volume, 1e-9 * volume) << i;
    for (std::uint32_t t = 0; t < topology.tet_count(); ++t)
      if (topology.has_tet(TetIndex(t))) {
        ASSERT_GT(six_volumes(rest_corners(topology, topology.tet(TetIndex(t)))), 0) << i;
      }
  }
  EXPECT_GT(done, 0u);
}

}  // namespace
}  // namespace trocar::cutting::testing
