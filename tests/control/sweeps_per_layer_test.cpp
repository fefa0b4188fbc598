// Fewer sweeps for deeper layers: what the solver does with them, and that no contact goes short.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/simulation.h"

namespace trocar::step {
namespace {

// A tool that presses into the top of a liver and leaves it again after `release`.
class Press {
 public:
  explicit Press(material::ElasticLaw law, unsigned workers = 1, Tick release = 700)
      : simulation_(organ_of(law), workers), release_(release) {
    const auto& world = simulation_.state().world;
    for (const auto node : world.surface_nodes)
      if (world.rest_positions[node.value].y > top_.y) top_ = world.rest_positions[node.value];
  }

  const TickReport& tick(const TickDecisions& decisions) {
    const Tick tick = simulation_.current_tick() + 1;
    hands::TickInputs inputs;
    if (tick == 1) {
      hands::HandJoin join{.slot = {0}};
      join.shapes[0] = {.radius_m = 0.03f, .length_m = 0.2f, .reach_m = 0.008f};
      inputs.joins.push_back(join);
    }
    const float depth =
        tick < release_ ? 0.008f * std::min(1.0f, 2e-3f * static_cast<float>(tick)) : -0.05f;
    if (tick % 8 == 1)
      inputs.samples.push_back(
          {tool_slot({0}, 0),
           {{top_ - Vec3f{0, depth, 0}, rotation_from_z({0, 1, 0})}, tool::Verb::Push}});
    return simulation_.tick(inputs, decisions);
  }
  double kinetic_energy_j() const {
    const auto& world = simulation_.state().world;
    double energy = 0;
    for (std::size_t n = 0; n < world.node_count(); ++n)
      energy += 0.5 * static_cast<double>(world.masses[n]) *
                length_squared(to_double(world.velocities[n]));
    return energy;
  }
  const Simulation& simulation() const { return simulation_; }

 private:
  static organ::Organ organ_of(material::ElasticLaw law) {
    auto organ = *catalogue::make_liver(3000);
    organ.material.elastic_law = law;
    return organ;
  }

  Simulation simulation_;
  Vec3f top_;
  Tick release_;
};

TickDecisions with_layers(std::uint32_t touched, std::uint32_t one, std::uint32_t two,
                          std::uint32_t deep) {
  TickDecisions decisions;
  decisions.sweeps = touched;
  decisions.layer_sweeps = {one, two, deep};
  return decisions;
}

TEST(SweepsPerLayer, EqualOnesAreThoseOfBefore) {
  Press plain(material::ElasticLaw::NeoHookean), equal(material::ElasticLaw::NeoHookean);
  for (int i = 0; i < 400; ++i)
    ASSERT_EQ(plain.tick({}).state_hash, equal.tick(with_layers(4, 4, 4, 4)).state_hash);
}

TEST(SweepsPerLayer, AreWhatTheReportCounts) {
  Press press(material::ElasticLaw::Springs);
  const auto free = static_cast<std::uint64_t>(
      std::ranges::count_if(press.simulation().state().world.node_classes,
                            [](auto node_class) { return node_class != world::NodeClass::Fixed; }));
  std::uint64_t most = 0;
  for (const auto& decisions :
       {with_layers(4, 4, 4, 4), with_layers(4, 3, 2, 1), with_layers(5, 5, 1, 1),
        with_layers(2, 1, 1, 1), with_layers(4, 0, 2, 0)})
    for (int i = 0; i < 150; ++i) {
      const auto& report = press.tick(decisions);
      const auto sweeps = sweeps_of_layers(decisions);
      std::uint64_t expected = 0, active = 0;
      for (std::size_t layer = 0; layer < kSweepLayers; ++layer) {
        expected += std::uint64_t{report.solve.layer_nodes[layer]} * sweeps[layer];
        active += report.solve.layer_nodes[layer];
      }
      expected += (free - active) * report.solve.figures.far_sweeps;
      ASSERT_EQ(report.solve.node_sweeps, expected);
      ASSERT_EQ(active, report.near.active_nodes);
      most = std::max<std::uint64_t>(most, report.solve.layer_nodes[0]);
    }
  EXPECT_GT(most, 3u) << "the tool touches";
}

TEST(SweepsPerLayer, DoNotDependOnTheNumberOfWorkers) {
  Press one(material::ElasticLaw::NeoHookean, 1), two(material::ElasticLaw::NeoHookean, 2);
  for (int i = 0; i < 300; ++i)
    ASSERT_EQ(one.tick(with_layers(4, 3, 2, 1)).state_hash,
              two.tick(with_layers(4, 3, 2, 1)).state_hash);
}

// Nothing the controller may choose makes the tissue ring: what a press leaves dies away as it does
// with all sweeps, within a factor.
TEST(SweepsPerLayer, AreStable) {
  for (const auto law : {material::ElasticLaw::Springs, material::ElasticLaw::NeoHookean}) {
    double usual = 0;
    for (const auto& decisions :
         {with_layers(4, 4, 4, 4), with_layers(4, 1, 1, 1), with_layers(2, 1, 1, 1)}) {
      Press press(law);
      double most = 0;
      for (int i = 0; i < 2000; ++i) {
        const auto& report = press.tick(decisions);
        ASSERT_EQ(report.solve.nodes_rejected, 0u);
        if (i < 700) most = std::max(most, press.kinetic_energy_j());
      }
      const double left = press.kinetic_energy_j();
      EXPECT_LT(left, 0.05 * most) << decisions.sweeps << ' ' << decisions.layer_sweeps[0];
      if (decisions.layer_sweeps[0] == 4) usual = most;
      EXPECT_LT(most, 1.5 * usual);
    }
  }
}

TEST(SweepsPerLayer, WhateverTheNodeLimitTouchedNodesAreInTheQueue) {
  for (const auto boundary : {world::Boundary::Graded, world::Boundary::Frozen}) {
    Press press(material::ElasticLaw::NeoHookean);
    TickDecisions decisions{.node_limit = 1, .sweeps = 2, .boundary = boundary};
    decisions.layer_sweeps = {1, 1, 1};
    std::uint32_t most = 0;
    for (int i = 0; i < 600; ++i) {
      const auto& report = press.tick(decisions);
      ASSERT_GE(report.near.queue_nodes, report.contact.nodes);
      for (const auto node : press.simulation().context().contact.found.seeds)
        ASSERT_EQ(press.simulation().context().near.queue.layer_of(node), 0u);
      most = std::max(most, report.contact.nodes);
    }
    EXPECT_GT(most, 2u);
  }
}

TEST(SweepsPerLayer, MoreThanTheLayerBeforeIsRefusedByName) {
  EXPECT_TRUE(validate(with_layers(4, 3, 2, 1)).ok());
  EXPECT_TRUE(validate(with_layers(4, 0, 0, 1)).ok());
  for (const auto& wrong :
       {with_layers(4, 5, 1, 1), with_layers(4, 3, 4, 1), with_layers(4, 3, 0, 4)}) {
    const auto refused = validate(wrong);
    ASSERT_FALSE(refused.ok());
    EXPECT_NE(refused.error().message.find("layer_sweeps"), std::string::npos);
  }
}

}  // namespace
}  // namespace trocar::step
