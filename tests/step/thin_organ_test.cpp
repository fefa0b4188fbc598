// A thin organ hangs from one side while it is cut, and goes on hanging by what is left.

#include <gtest/gtest.h>

#include "server/lab/scenario/scenario_block.h"
#include "server/tissue/cutting/faces.h"
#include "server/tissue/step/simulation.h"
#include "tests/support/random.h"

namespace trocar::step {
namespace {

using trocar::testing::Random;

// A sheet of one layer of cells, 96 mm square and 4 mm thick, held at one edge.
organ::Organ sheet() {
  auto organ = *scenario::make_block({.nx = 25, .ny = 2, .nz = 25, .spacing_m = 0.004});
  organ.material.elastic_law = material::ElasticLaw::NeoHookean;
  organ.material.young_modulus_pa = 2000;
  organ.material.poisson_ratio = 0.45;
  organ.material.node_damping_per_s = 10;
  organ.gravity_m_s2 = {0, -9.81, 0};
  organ.fixed_nodes.clear();
  double least = 1;
  for (const auto& p : organ.mesh.rest_positions) least = std::min(least, p.x);
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
    if (organ.mesh.rest_positions[n].x < least + 1e-6) organ.fixed_nodes.push_back(NodeIndex(n));
  organ.node_masses_kg = organ::lumped_masses(organ);
  return organ;
}

// Strokes through two nodes each, where these hang when a stroke begins.
class HangingSheet {
 public:
  static constexpr Tick kFirst = 600, kStroke = 500, kStrokes = 5;

  explicit HangingSheet(std::uint64_t seed) : simulation_(sheet()), random_(seed) {
    decisions_ = simulation_.with_sweeps_for_organ({});
  }
  const Simulation& simulation() const { return simulation_; }

  const TickReport& tick() {
    const Tick tick = simulation_.current_tick() + 1;
    hands::TickInputs inputs;
    if (tick == 1) {
      hands::HandJoin join{.slot = {0}};
      join.shapes[0] = {.radius_m = 0.001f, .length_m = 0.3f, .edge_m = 0.04f};
      inputs.joins.push_back(join);
    }
    const Tick since = tick < kFirst ? kStroke : (tick - kFirst) % kStroke;
    const bool cuts = tick >= kFirst && tick < kFirst + kStrokes * kStroke;
    if (cuts && since == 0) from_ = any_place(), to_ = any_place();
    if (tick % 4 == 1) {
      const float way = 1.4f * static_cast<float>(since) / static_cast<float>(kStroke) - 0.2f;
      const Vec3f tip = cuts ? from_ + (to_ - from_) * way - kShaft * 0.02f : Vec3f{0, 1, 0};
      inputs.samples.push_back(
          {tool_slot({0}, 0),
           {{tip, rotation_from_z(kShaft)}, cuts ? tool::Verb::Cut : tool::Verb::None}});
    }
    return simulation_.tick(inputs, decisions_);
  }

 private:
  static constexpr Vec3f kShaft{0.0976f, 0.9759f, 0.1952f};

  Vec3f any_place() {
    const auto& world = simulation_.state().world;
    return world.position(NodeIndex(random_.below(static_cast<std::uint32_t>(world.node_count()))));
  }

  Simulation simulation_;
  TickDecisions decisions_;
  Random random_;
  Vec3f from_, to_;
};

bool is_inverted(const topology::Topology& topology, const world::World& world, TetIndex t) {
  std::array<Vec3d, 4> corners;
  for (std::size_t i = 0; i < 4; ++i) corners[i] = to_double(world.position(topology.tet(t)[i]));
  return cutting::six_volumes(corners) <= 0;
}

// Whether node and triangle are the corners of one tet.
bool is_of_one_tet(const topology::Topology& topology, const contact::ContactPoint& point) {
  const auto tets = topology.tets_of(point.nodes[0]);
  return std::any_of(tets.begin(), tets.end(), [&](TetIndex t) {
    const auto& tet = topology.tet(t);
    return std::ranges::all_of(point.nodes,
                               [&](NodeIndex n) { return cutting::corner_of(tet, n) < 4; });
  });
}

TEST(ThinOrgan, NothingStaysInvertedWhileItHangs) {
  HangingSheet hanging(3);
  std::vector<std::uint32_t> inverted_for;
  std::size_t crossed = 0;
  std::uint32_t longest = 0;
  while (hanging.simulation().current_tick() < 4000) {
    crossed += hanging.tick().cut.crossed_tets;
    const auto& state = hanging.simulation().state();
    const auto& topology = state.cuts.topology();
    for (const auto& point : hanging.simulation().context().contact.found.self_points())
      ASSERT_FALSE(is_of_one_tet(topology, point)) << "tick " << state.world.tick;
    inverted_for.resize(topology.tet_count());
    for (std::uint32_t t = 0; t < topology.tet_count(); ++t) {
      const TetIndex tet(t);
      const bool is = topology.has_tet(tet) && is_inverted(topology, state.world, tet);
      inverted_for[t] = is ? inverted_for[t] + 1 : 0;
      longest = std::max(longest, inverted_for[t]);
    }
  }
  EXPECT_GT(crossed, 1000u);
  EXPECT_LT(longest, 100u) << "ticks";
}

}  // namespace
}  // namespace trocar::step
