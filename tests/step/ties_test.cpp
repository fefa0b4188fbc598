// Ties through the simulation: a strip comes off at the energy of its bed, the same on any number
// of workers and after a snapshot, and a blade cuts what it goes through.

#include <gtest/gtest.h>

#include <functional>

#include "server/tissue/step/tie_breaks.h"
#include "tests/support/tied_strip.h"

namespace trocar::step {
namespace {

using testing::Peel;

TEST(Ties, AStripComesOffAtTheToughnessOfItsBed) {
  for (const double spacing_mm : {5.0, 2.0})
    EXPECT_NEAR(testing::peel_work({.spacing_mm = spacing_mm}, 4) / 20, 1, 0.15)
        << spacing_mm << " mm";
}

TEST(Ties, TheHashKnowsHowFarEachHasBeenPulled) {
  Peel peel({});
  for (int i = 0; i < 50; ++i) peel.tick();
  auto& simulation = peel.simulation();
  const auto before = simulation.state_hash();
  Bytes snapshot;
  simulation.write_snapshot(snapshot);
  auto& extensions = const_cast<world::World&>(simulation.state().world).tie_extensions;
  extensions.back() += 1e-6f;
  EXPECT_NE(simulation.state_hash(), before);
  ASSERT_TRUE(simulation.restore_snapshot(snapshot).ok());
  EXPECT_EQ(simulation.state_hash(), before);
}

TEST(Ties, OfASnapshotInMidPeelGoOnBitForBitWithAnyWorkers) {
  Peel peel({});
  std::uint32_t broken = 0;
  while (broken < 20) broken += peel.tick().ties.broken;
  Bytes snapshot;
  peel.simulation().write_snapshot(snapshot);
  std::vector<std::uint64_t> hashes;
  for (int i = 0; i < 120; ++i) {
    hashes.push_back(peel.tick().state_hash);
    broken += peel.simulation().context().report.ties.broken;
  }
  EXPECT_GT(broken, 25u) << "it goes on peeling";
  for (const unsigned workers : {1u, 2u, 3u}) {
    Peel other({}, 0.1, workers);
    ASSERT_TRUE(other.simulation().restore_snapshot(snapshot).ok());
    for (std::size_t i = 0; i < hashes.size(); ++i)
      ASSERT_EQ(other.tick().state_hash, hashes[i]) << workers << " workers, tick " << i;
  }
}

TEST(Ties, OfADamagedSnapshotAreRefused) {
  Peel peel({});
  peel.tick();
  auto& world = const_cast<world::World&>(peel.simulation().state().world);
  for (const float wrong : {-1.0f, std::nanf(""), 1e30f}) {
    const float kept = std::exchange(world.tie_extensions[3], wrong);
    Bytes snapshot;
    peel.simulation().write_snapshot(snapshot);
    EXPECT_FALSE(peel.simulation().restore_snapshot(snapshot).ok()) << wrong;
    world.tie_extensions[3] = kept;
  }
}

// A soft strip lies on its bed, without anything that holds or moves it but hands.
class Hands {
 public:
  Hands() : simulation_(testing::make_strip({.width_mm = 20, .young_modulus_pa = 1e4})) {}

  void join(tool::Form form, std::uint8_t hand = 0) {
    hands::HandJoin join{.slot = {hand}};
    join.shapes[0] = {.radius_m = 0.001f, .length_m = 0.3f, .reach_m = 0.006f};
    join.shapes[0].form = form;
    join.shapes[0].edge_m = 0.03f;
    inputs_.joins.push_back(join);
  }
  void sample(const Vec3f& place, const Vec3f& axis, tool::Verb verb, std::uint8_t hand = 0) {
    inputs_.samples.push_back({tool_slot({hand}, 0), {{place, rotation_from_z(axis)}, verb}});
  }
  void mark(hands::MarkAction action) { inputs_.mark = action; }
  const TickReport& tick() {
    const auto& report = simulation_.tick(inputs_, {});
    inputs_ = {};
    return report;
  }
  Simulation& simulation() { return simulation_; }

 private:
  Simulation simulation_;
  hands::TickInputs inputs_;
};

// Draws a blade that lies across the strip along the gap, to x.
std::uint32_t slit(
    Hands& hands, float from_m, float to_m, float height_m,
    const std::function<void()>& others = [] {}) {
  std::uint32_t broken = 0;
  constexpr float kSpeed_m_s = 0.1f;
  const int ticks = static_cast<int>((to_m - from_m) / (kSpeed_m_s * 1e-3f));
  for (int i = 0; i < ticks; ++i) {
    if (i % 4 == 0) others();
    if (i % 4 == 0)
      hands.sample({from_m + kSpeed_m_s * 1e-3f * static_cast<float>(i), height_m, -0.015f},
                   {0, 0, 1}, tool::Verb::Cut);
    broken += hands.tick().ties.broken;
  }
  return broken;
}

TEST(Ties, ThatABladeGoesThroughAreCut) {
  Hands hands;
  const auto& ties = hands.simulation().state().cuts.topology().ties();
  ASSERT_GT(ties.count(), 100u);
  const auto y = static_cast<float>(0.5 * (ties[0].ends[0].place_m.y + ties[0].ends[1].place_m.y));
  hands.join(tool::Form::Scalpel);
  const auto broken = slit(hands, -0.04f, 0.0f, y);
  EXPECT_GT(broken, 100u);
  for (std::size_t i = 0; i < ties.count(); ++i) {
    const double x = ties[i].ends[0].place_m.x;
    if (x < -0.003) {
      EXPECT_TRUE(ties[i].is_broken) << i << " at " << x;
    }
    if (x > 0.003) {
      EXPECT_FALSE(ties[i].is_broken) << i << " at " << x;
    }
  }
}

TEST(Ties, AllCutTheStripIsAFreePiece) {
  Hands hands;
  auto& simulation = hands.simulation();
  const auto& ties = simulation.state().cuts.topology().ties();
  hands.tick();
  const auto& pieces = simulation.context().pieces.list();
  EXPECT_EQ(pieces.size(), 0u) << "its bed holds it";
  const auto y = static_cast<float>(0.5 * (ties[0].ends[0].place_m.y + ties[0].ends[1].place_m.y));
  hands.join(tool::Form::Scalpel);
  const auto broken = slit(hands, -0.04f, 0.04f, y);
  EXPECT_EQ(broken, ties.count());
  ASSERT_EQ(pieces.size(), 1u);
  EXPECT_EQ(pieces[0].nodes.size(), simulation.organ().regions[1].nodes.size());
  // It is the same from a snapshot.
  Bytes snapshot;
  simulation.write_snapshot(snapshot);
  Hands other;
  ASSERT_TRUE(other.simulation().restore_snapshot(snapshot).ok());
  EXPECT_EQ(other.simulation().context().pieces.list().size(), 1u);
  for (int i = 0; i < 20; ++i)
    ASSERT_EQ(other.tick().state_hash, hands.tick().state_hash) << "tick " << i;
}

// A cut of the strip from above leaves the bed tied to what lies on it.
TEST(Ties, GoOnFromTheirPlacesAfterACut) {
  Hands hands;
  auto& simulation = hands.simulation();
  const auto& ties = simulation.state().cuts.topology().ties();
  const auto rest = [&](const topology::TieNet::End& end) {
    Vec3d place;
    for (std::size_t k = 0; k < 3; ++k)
      place += simulation.state().cuts.topology().rest()[end.nodes[k].value] * end.weights[k];
    return place;
  };
  double top = -1;
  for (const auto& p : simulation.organ().mesh.rest_positions) top = std::max(top, p.y);
  hands.join(tool::Form::Scalpel);
  double area = 0;
  for (int i = 0; i < 400; ++i) {
    const float z = -0.02f + 1e-4f * static_cast<float>(i);
    if (i % 4 == 0)
      hands.sample({0.003f, static_cast<float>(top) - 0.0015f, z}, {0, 1, 0}, tool::Verb::Cut);
    area += hands.tick().cut.opened_area_m2;
  }
  for (int i = 0; i < 200; ++i) area += hands.tick().cut.opened_area_m2;
  ASSERT_GT(area, 1e-5) << "the strip is cut";
  std::size_t moved = 0, gone = 0;
  const auto triangles = simulation.organ().mesh.boundary_triangles.size();
  for (std::size_t i = 0; i < ties.count(); ++i) {
    gone += ties[i].is_gone ? 1 : 0;
    for (const auto& end : ties[i].ends) {
      moved += end.triangle.value >= triangles ? 1 : 0;
      if (!ties[i].is_gone) {
        EXPECT_LT(length(rest(end) - end.place_m), 2e-5) << "tie " << i;
      }
    }
  }
  EXPECT_GT(moved, 5u);
  EXPECT_LE(gone, ties.count() / 50);
  Bytes snapshot;
  simulation.write_snapshot(snapshot);
  Hands other;
  ASSERT_TRUE(other.simulation().restore_snapshot(snapshot).ok());
  for (int i = 0; i < 20; ++i)
    ASSERT_EQ(other.tick().state_hash, hands.tick().state_hash) << "tick " << i;
}

TEST(Ties, AreWholeAgainAtAMark) {
  Hands hands;
  auto& simulation = hands.simulation();
  const auto gap = [&] {
    const auto& tie = simulation.state().cuts.topology().ties()[0];
    return static_cast<float>(0.5 * (tie.ends[0].place_m.y + tie.ends[1].place_m.y));
  };
  const auto y = gap();
  hands.mark(hands::MarkAction::Set);
  hands.join(tool::Form::Scalpel);
  EXPECT_GT(slit(hands, -0.04f, 0.0f, y), 100u);
  const auto cut = hands.tick().ties.whole;
  hands.mark(hands::MarkAction::Return);
  EXPECT_GT(hands.tick().ties.whole, cut + 100);
  EXPECT_EQ(hands.tick().ties.whole, simulation.state().cuts.topology().ties().count());
}

// No blade cuts what another's jaws hold, ties neither.
TEST(Ties, BelongToWhoHoldsTheirNodes) {
  Hands hands;
  auto& simulation = hands.simulation();
  const auto& ties = simulation.state().cuts.topology().ties();
  double top = -1;
  for (const auto& p : simulation.organ().mesh.rest_positions) top = std::max(top, p.y);
  const auto y = static_cast<float>(0.5 * (ties[0].ends[0].place_m.y + ties[0].ends[1].place_m.y));
  hands.join(tool::Form::Scalpel);
  hands.join(tool::Form{}, 1);
  const auto grasp = [&] {
    hands.sample({0, static_cast<float>(top), 0}, {0, -1, 0}, tool::Verb::Grasp, 1);
  };
  for (int i = 0; i < 300; ++i) {
    if (i % 4 == 0) grasp();
    hands.tick();
  }
  const auto holder = tool_slot({1}, 0);
  ASSERT_FALSE(simulation.state().grasps[holder].nodes.empty());
  slit(hands, -0.04f, 0.04f, y, grasp);
  const auto& claims = simulation.state().claims;
  std::size_t held = 0;
  for (std::size_t i = 0; i < ties.count(); ++i)
    for (const auto& end : ties[i].ends)
      for (const auto node : end.nodes)
        if (claims.owner(node) == holder) {
          ++held;
          EXPECT_FALSE(ties[i].is_broken) << i;
        }
  EXPECT_GT(held, 0u);
}

}  // namespace
}  // namespace trocar::step
