// Random organs, materials, tools and decisions for 10,000 ticks: everything stays finite, fixed
// nodes stay fixed, energy never exceeds what tools put in, and a tool's force does not jump
// when classes of nodes or decisions change.

#include <gtest/gtest.h>

#include <cmath>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/simulation.h"
#include "tests/support/random.h"

namespace trocar::step {
namespace {

using testing::Random;

organ::Organ random_organ(Random& random) {
  using material::ElasticLaw;
  organ::Organ organ;
  if (random.below(3) == 0) {
    const auto side = [&] { return 4 + static_cast<int>(random.below(6)); };
    organ = *catalogue::make_lattice({.nx = side(), .ny = side(), .nz = side()});
    organ.material.spring_stiffness_n_m = random.between(5, 200);
  } else {
    organ = *catalogue::make_liver(500 + static_cast<int>(random.below(2500)));
    organ.material.elastic_law = static_cast<ElasticLaw>(random.below(3));
    organ.material.young_modulus_pa = random.between(1500, 20000);
    organ.material.poisson_ratio = random.between(0.1, 0.48);
    organ.material.has_averaged_strain = random.below(2) == 0;
  }
  organ.material.node_damping_per_s = random.between(2, 40);
  organ.material.edge_damping_time_s = random.below(2) == 0 ? 0 : random.between(0, 0.003);
  return organ;
}

// The default of the programs: measured, its stress relaxes; with or without tension.
organ::Organ measured_liver(Random& random) {
  auto organ = *catalogue::make_measured_liver(500 + static_cast<int>(random.below(2500)));
  organ.material.tension = random.below(2) == 0 ? 0 : random.between(0, 0.05);
  organ.material.has_averaged_strain = random.below(2) == 0;
  return organ;
}

// Tools that walk from target to target above, on and in the organ.
struct Walker {
  Vec3f from, to;
  Tick begin = 0, end = 1;
  tool::Verb verb = tool::Verb::None;

  Vec3f at(Tick tick) const {
    const float s =
        std::clamp(static_cast<float>(tick - begin) / static_cast<float>(end - begin), 0.0f, 1.0f);
    return from + (to - from) * s;
  }
};

void walk(Walker& walker, Tick tick, const world::World& world, Random& random) {
  if (tick < walker.end) return;
  walker.from = walker.at(tick);
  const auto& surface = world.surface_nodes;
  const auto node = surface[random.below(static_cast<std::uint32_t>(surface.size()))];
  const Vec3f rest = world.rest_positions[node.value];
  const Vec3f outward = normalized(rest, Vec3f{0, 1, 0});
  walker.to = rest + outward * static_cast<float>(random.between(-0.012, 0.02));
  walker.begin = tick;
  walker.end = tick + 200 + random.below(600);
  walker.verb = static_cast<tool::Verb>(random.below(3));
}

double energy_of(const Simulation& simulation) {
  const auto& world = simulation.state().world;
  double energy = simulation.context().solve.solver.tissue().energy_j(world.displacements);
  for (std::size_t n = 0; n < world.node_count(); ++n)
    energy +=
        0.5 * static_cast<double>(world.masses[n]) * length_squared(to_double(world.velocities[n]));
  return energy;
}

class LongRun : public ::testing::TestWithParam<std::uint64_t> {};

TEST_P(LongRun, StaysFiniteBoundedAndInPlace) {
  Random random(GetParam());
  Simulation simulation(GetParam() <= 8 ? random_organ(random) : measured_liver(random));
  const auto& world = simulation.state().world;
  const double rest_energy = energy_of(simulation);
  constexpr std::uint8_t kHands = 3;
  std::array<Walker, kHands> walkers;
  for (auto& walker : walkers) walker.from = walker.to = {0, 0.4f, 0};
  TickDecisions decisions;
  hands::TickInputs inputs;
  double work = 0, largest_excess = 0;  // J
  std::array<Vec3f, kMaxTools> tips{};
  for (Tick tick = 1; tick <= 10'000; ++tick) {
    inputs.clear();
    for (std::uint8_t hand = 0; hand < kHands; ++hand) {
      if (tick == 1) {
        hands::HandJoin join{.slot = {hand}};
        join.shapes[0] = {.radius_m = 0.008f, .length_m = 0.2f, .reach_m = 0.008f};
        inputs.joins.push_back(join);
      }
      walk(walkers[hand], tick, world, random);
      if (tick % 8 == 1)
        inputs.samples.push_back(
            {tool_slot({hand}, 0),
             {{walkers[hand].at(tick), rotation_from_z({0, 1, 0})}, walkers[hand].verb}});
    }
    if (tick % 500 == 0) {
      decisions.boundary = random.below(2) == 0 ? world::Boundary::Graded : world::Boundary::Frozen;
      decisions.depth_limit = 1 + random.below(7);
      decisions.node_limit = 50 + random.below(1500);
      decisions.sweeps = 3 + random.below(4);
    }
    const auto& report = simulation.tick(inputs, decisions);
    ASSERT_EQ(report.solve.nodes_rejected, 0u) << "tick " << tick;
    for (const auto& contact : simulation.context().contact.found.tools) {
      const Vec3f tip = contact.goal.position;
      const Vec3f force =
          contact::reaction_on(simulation.context().contact.found, contact, world).force_n;
      work += std::max(0.0, -dot(to_double(force), to_double(tip - tips[contact.tool.value])));
    }
    for (std::uint8_t i = 0; i < kMaxTools; ++i)
      tips[i] = simulation.state().tools[ToolSlot{i}].pose.position;
    for (const auto& contact : simulation.context().contact.found.tools)
      tips[contact.tool.value] = contact.goal.position;
    if (tick % 50 != 0) continue;
    const double energy = energy_of(simulation) - rest_energy;
    largest_excess = std::max(largest_excess, energy - work);
  }
  for (std::size_t n = 0; n < world.node_count(); ++n) {
    ASSERT_TRUE(is_finite(world.displacements[n]) && is_finite(world.velocities[n]));
    if (world.node_classes[n] != world::NodeClass::Fixed) continue;
    ASSERT_EQ(world.displacements[n], Vec3f{});
    ASSERT_EQ(world.velocities[n], Vec3f{});
  }
  EXPECT_GT(work, 1e-3) << "tools did something";
  // Forces are of the end of a tick: work is known to about that.
  EXPECT_LT(largest_excess, 0.01 * work) << "no more energy than the tools put in";
  // And without tools it dies away.
  inputs.clear();
  inputs.leaves = {{0}, {1}, {2}};
  const double before = energy_of(simulation) - rest_energy;
  for (int tick = 0; tick < 3000; ++tick) {
    simulation.tick(inputs, decisions);
    inputs.clear();
  }
  EXPECT_LE(energy_of(simulation) - rest_energy, before * 1.001 + 1e-9);
}

INSTANTIATE_TEST_SUITE_P(Seeds, LongRun, ::testing::Range<std::uint64_t>(1, 12));

// A tool holds still, pressed in; then decisions change. Its force may not step.
class ForceAcrossDecisions : public ::testing::TestWithParam<material::ElasticLaw> {};

TEST_P(ForceAcrossDecisions, DoesNotStep) {
  auto organ = *catalogue::make_liver(6000);
  organ.material.elastic_law = GetParam();
  Simulation simulation(organ);
  const auto& world = simulation.state().world;
  NodeIndex top = world.surface_nodes.front();
  for (const auto node : world.surface_nodes)
    if (world.rest_positions[node.value].y > world.rest_positions[top.value].y) top = node;
  const Vec3f over = world.rest_positions[top.value];
  hands::TickInputs inputs;
  hands::HandJoin join{.slot = {0}};
  join.shapes[0] = {.radius_m = 0.012f, .length_m = 0.2f, .reach_m = 0.008f};
  inputs.joins.push_back(join);
  TickDecisions decisions;
  const auto force = [&]() -> double {
    const auto& contacts = simulation.context().contact.found;
    if (contacts.tools.empty()) return 0;
    return static_cast<double>(
        length(contact::reaction_on(contacts, contacts.tools[0], world).force_n));
  };
  double last = 0, worst = 0, peak = 0;
  for (Tick tick = 1; tick <= 4000; ++tick) {
    if (tick % 8 == 1) {
      const float press = 0.010f * std::min(1.0f, static_cast<float>(tick) * 1e-3f) - 0.003f;
      inputs.samples.push_back(
          {tool_slot({0}, 0),
           {{over - Vec3f{0, press, 0}, rotation_from_z({0, 1, 0})}, tool::Verb::Push}});
    }
    if (tick == 1800) decisions.sweeps = 3;
    if (tick == 2000) decisions.depth_limit = 1;
    if (tick == 2200) decisions.depth_limit = 6;
    if (tick == 2400) decisions.node_limit = 100;
    if (tick == 2600) decisions.boundary = world::Boundary::Frozen;
    if (tick == 3000) decisions.node_limit = 1200;
    if (tick == 3200) decisions.boundary = world::Boundary::Graded;
    simulation.tick(inputs, decisions);
    inputs.clear();
    const double now = force();
    peak = std::max(peak, now);
    if (tick > 1790) worst = std::max(worst, std::abs(now - last));
    last = now;
  }
  EXPECT_GT(peak, 0.03) << "the tool presses";
  EXPECT_LT(worst, 0.02 * peak);
}

INSTANTIATE_TEST_SUITE_P(Laws, ForceAcrossDecisions,
                         ::testing::Values(material::ElasticLaw::Springs,
                                           material::ElasticLaw::TensorMass,
                                           material::ElasticLaw::NeoHookean));

}  // namespace
}  // namespace trocar::step
