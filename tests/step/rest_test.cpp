// Tissue that nobody touches falls asleep and wakes in time, and free pieces move as free bodies.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/base/bytes.h"
#include "server/lab/scenario/scenario_block.h"
#include "server/tissue/contact/contact_law.h"
#include "server/tissue/cutting/validate.h"
#include "server/tissue/pieces/rigid_motion.h"
#include "tests/step/hands.h"
#include "tests/support/random.h"

namespace trocar::step {
namespace {

using trocar::testing::Random;

// A block without a fixed node: 2 nodes along an edge make a chip of a few tets.
organ::Organ free_block(int nodes, const Vec3d& gravity = {}) {
  auto organ = *scenario::make_block({.nx = nodes, .ny = nodes, .nz = nodes, .spacing_m = 0.004});
  organ.material.elastic_law = material::ElasticLaw::NeoHookean;
  organ.material.node_damping_per_s = length(gravity) > 0 ? 10 : 0;
  organ.gravity_m_s2 = gravity;
  organ.fixed_nodes.clear();
  organ.node_masses_kg = organ::lumped_masses(organ);
  return organ;
}

std::vector<NodeIndex> all_nodes(const world::World& world) {
  std::vector<NodeIndex> nodes;
  for (std::uint32_t n = 0; n < world.node_count(); ++n) nodes.push_back(NodeIndex(n));
  return nodes;
}

// Returns the energy of motion and of strain, J.
double energy_of(const Simulation& simulation) {
  const auto& world = simulation.state().world;
  const auto& tissue = simulation.context().solve.solver.tissue();
  double energy = tissue.energy_j(world.displacements) -
                  tissue.energy_j(std::vector<Vec3f>(world.node_count()));
  for (std::size_t n = 0; n < world.node_count(); ++n)
    energy +=
        0.5 * static_cast<double>(world.masses[n]) * length_squared(to_double(world.velocities[n]));
  return energy;
}

class FreeBlock : public ::testing::TestWithParam<int> {};

TEST_P(FreeBlock, KeepsMomentumAndSpinAndGainsNoEnergy) {
  Simulation simulation(free_block(GetParam()));
  Random random(7);
  std::vector<Vec3f> velocities;
  for (const Vec3f arm : simulation.state().world.rest_positions) {
    const auto any = [&] { return static_cast<float>(random.between(-0.05, 0.05)); };
    velocities.push_back(Vec3f{0.3f, 0.1f, -0.2f} + cross(Vec3f{8, -3, 5}, arm) +
                         Vec3f{any(), any(), any()});
  }
  simulation.start_relaxed(std::vector<Vec3f>(velocities.size()), velocities);
  const auto nodes = all_nodes(simulation.state().world);
  auto last = pieces::motion_of(nodes, simulation.state().world);
  const auto first = last;
  const double begin = energy_of(simulation);
  double least = begin;
  bool has_flown = false;
  for (int tick = 1; tick <= 800; ++tick) {
    simulation.tick({}, {});
    const auto now = pieces::motion_of(nodes, simulation.state().world);
    ASSERT_LT(length(now.velocity - last.velocity), 1e-5 * length(first.velocity)) << tick;
    ASSERT_LT(length(now.spin - last.spin), 1e-5 * length(first.spin)) << tick;
    last = now;
    const double energy = energy_of(simulation);
    ASSERT_LT(energy, least + 1e-5 * begin) << "tick " << tick;
    least = std::min(least, energy);
    has_flown |= simulation.state().world.node_classes[0] == world::NodeClass::Asleep;
  }
  EXPECT_LT(length(last.velocity - first.velocity), 1e-4 * length(first.velocity));
  EXPECT_LT(length(last.spin - first.spin), 1e-4 * length(first.spin)) << "what rounding comes to";
  EXPECT_EQ(has_flown, GetParam() <= 3) << "once its shape is at rest, it is carried";
}

INSTANTIATE_TEST_SUITE_P(Sizes, FreeBlock, ::testing::Values(2, 3, 6));

// Relaxed stress of a trapped piece of light nodes once made it move for ever, and ever faster.
TEST(FreePiece, HasNoStressThatRelaxed) {
  auto organ = free_block(3);
  material::use_measured(*material::find_measured_material("human_liver_nava2008"), organ.material);
  Simulation simulation(std::move(organ));
  const auto& world = simulation.state().world;
  std::vector<Vec3f> velocities;
  for (const auto& place : world.rest_positions) velocities.push_back(place * 20.0f);
  simulation.start_relaxed(std::vector<Vec3f>(velocities.size()), velocities);
  ASSERT_FALSE(world.relaxation.is_empty());
  float stretched = 0;
  for (int tick = 0; tick < 30; ++tick) {
    simulation.tick({}, {});
    for (const auto& displacement : world.displacements)
      stretched = std::max(stretched, length(displacement));
    for (const auto& force : world.relaxation.forces()) ASSERT_EQ(force, Vec3f{});
  }
  EXPECT_GT(stretched, 1e-4f);
}

TEST(FreePiece, FallsAndLiesDownOnTheFloor) {
  Simulation simulation(free_block(3, {0, -9.81, 0}));
  const auto nodes = all_nodes(simulation.state().world);
  const double before = pieces::motion_of(nodes, simulation.state().world).centre.y;
  for (int tick = 1; tick <= 200; ++tick) {
    simulation.tick({}, {});
    const auto now = pieces::motion_of(nodes, simulation.state().world);
    ASSERT_NEAR(now.velocity.y, -9.81e-3 * tick, 1e-4) << "tick " << tick;
  }
  for (int tick = 0; tick < 200; ++tick) simulation.tick({}, {});
  const auto& world = simulation.state().world;
  const auto lying = pieces::motion_of(nodes, world);
  EXPECT_EQ(lying.velocity, Vec3d{});
  EXPECT_NEAR(lying.centre.y, before - pieces::kFloor_m, 0.006);
  EXPECT_EQ(simulation.context().report.solve.node_sweeps, 0u) << "and costs nothing";
}

// A liver in which a blade cuts for 0.4 s; then it is left alone; from 1.6 s on a finger presses.
class Wound {
 public:
  static constexpr Tick kLeft = 400, kTouched = 1600;

  Wound() : simulation_(make()), top_(highest(simulation_.organ())) {}

  static organ::Organ make() {
    auto organ = *catalogue::make_liver(2500);
    organ.material.elastic_law = material::ElasticLaw::NeoHookean;
    return organ;
  }
  Simulation& simulation() { return simulation_; }
  const world::World& world() const { return simulation_.state().world; }

  hands::TickInputs inputs_of(Tick tick) const {
    hands::TickInputs inputs;
    if (tick == 1)
      for (std::uint8_t hand = 0; hand < 2; ++hand) {
        hands::HandJoin join{.slot = {hand}};
        join.shapes[0] = {
            .radius_m = hand == 0 ? 0.002f : 0.008f, .length_m = 0.3f, .edge_m = 0.06f};
        inputs.joins.push_back(join);
      }
    if (tick % 4 != 1) return inputs;
    const auto put = [&](std::uint8_t hand, const Vec3f& tip, tool::Verb verb) {
      inputs.samples.push_back({tool_slot({hand}, 0), {{tip, rotation_from_z({0, 1, 0})}, verb}});
    };
    const float t = static_cast<float>(tick) * 1e-3f;
    const float along = 0.2f * t - 0.04f;
    if (tick <= kLeft)
      put(0, top_ + Vec3f{along, -0.025f, 0.01f * std::sin(20 * t)}, tool::Verb::Cut);
    else
      put(0, top_ + Vec3f{0, 0.2f, 0}, tool::Verb::None);
    const float press = 0.05f * std::max(0.0f, t - 1e-3f * static_cast<float>(kTouched));
    put(1, top_ + Vec3f{0.01f, 0.004f - std::min(0.012f, press), 0}, tool::Verb::Push);
    return inputs;
  }
  const TickReport& tick() {
    return simulation_.tick(inputs_of(simulation_.current_tick() + 1), {});
  }

 private:
  static Vec3f highest(const organ::Organ& organ) {
    Vec3d top{0, -1, 0};
    for (const auto& p : organ.mesh.rest_positions)
      if (p.y > top.y) top = p;
    return to_float(top);
  }

  Simulation simulation_;
  const Vec3f top_;
};

TEST(Rest, AWoundThatNobodyTouchesFallsAsleepAndStaysWhereItIs) {
  Wound wound;
  while (wound.simulation().current_tick() < Wound::kTouched - 300) wound.tick();
  const auto shape = wound.world().displacements;
  EXPECT_FALSE(wound.simulation().state().self_contacts.nodes().empty()) << "the lips are pairs";
  for (int i = 0; i < 300; ++i) {
    const auto& report = wound.tick();
    ASSERT_EQ(report.solve.node_sweeps, 0u);
    ASSERT_EQ(report.near.active_nodes, 0u);
  }
  EXPECT_EQ(wound.world().displacements, shape);
  EXPECT_TRUE(cutting::validate(wound.simulation().state().cuts.topology()).ok());
  // It wakes in the tick in which the finger has its first point, and the force begins smoothly.
  float last = 0, worst = 0, most = 0;
  bool is_touched = false;
  for (int i = 0; i < 400; ++i) {
    const auto& report = wound.tick();
    const auto& found = wound.simulation().context().contact.found;
    is_touched |= found.self_begin > 0;
    ASSERT_EQ(report.solve.node_sweeps > 0, is_touched);
    for (const auto& tool : found.tools) {
      const float force = length(contact::reaction_on(found, tool, wound.world()).force_n);
      worst = std::max(worst, std::abs(force - last));
      most = std::max(most, force);
      last = force;
    }
  }
  EXPECT_TRUE(is_touched);
  EXPECT_GT(most, 0.02f);
  EXPECT_LT(worst, 0.04f * most) << "per ms, of a press within 0.24 s";
}

TEST(Rest, TissueBesideAWoundIsSweptMoreOnceTheBladeHasLeft) {
  constexpr Tick kOut = 400, kRests = kOut + 280;  // the blade is felt no more after 10 ms
  auto organ = *catalogue::make_liver(2000);
  organ.gravity_m_s2 = {0, -9.81, 0};  // It sways.
  const Vec3f top = to_float(*std::ranges::max_element(organ.mesh.rest_positions, {}, &Vec3d::y));
  Simulation simulation(organ);
  hands::TickInputs inputs;
  hands::HandJoin join{.slot = {0}};
  join.shapes[0] = {.radius_m = 0.001f, .length_m = 0.3f, .edge_m = 0.05f};
  inputs.joins.push_back(join);
  std::uint64_t cutting = 0, resting = 0;  // sweeps of nodes beside the wound in a tick
  for (Tick tick = 1; tick <= kRests + 20; ++tick) {
    const bool cuts = tick <= kOut;
    const Vec3f tip{2e-4f * static_cast<float>(tick) - 0.04f, cuts ? -0.025f : 0.2f, 0};
    inputs.samples.push_back(
        {tool_slot({0}, 0),
         {{top + tip, rotation_from_z({0, 1, 0})}, cuts ? tool::Verb::Cut : tool::Verb::None}});
    const auto& report = simulation.tick(inputs, {});
    inputs.clear();
    if (tick != kOut + 200 && tick != kRests + 20) continue;
    const auto free =
        std::ranges::count(simulation.state().world.node_classes, world::NodeClass::Far);
    const auto others = report.solve.figures.far_sweeps * static_cast<std::uint64_t>(free);
    (tick < kRests ? cutting : resting) = report.solve.far_node_sweeps - others;
  }
  EXPECT_GT(cutting, 10u);
  EXPECT_EQ(resting, 3 * cutting) << "four sweeps, of which others have one, against two";
}

// The work of a press, of the whole organ that moves with it.
struct PressWork {
  std::size_t most_active = 0, looked_at = 0, pairs = 0;
  std::uint64_t seeds = 0;
};

// A finger presses one end of a measured liver, at 20 mm/s at most, before and after a stroke
// through the other end.
PressWork press_beside(bool has_wound) {
  auto organ = *catalogue::make_measured_liver(6000);
  Vec3d least{1, 1, 1}, most{-1, -1, -1};
  for (const auto& p : organ.mesh.rest_positions) {
    least = {std::min(least.x, p.x), std::min(least.y, p.y), std::min(least.z, p.z)};
    most = {std::max(most.x, p.x), std::max(most.y, p.y), std::max(most.z, p.z)};
  }
  Vec3d top = least;
  for (const auto& p : organ.mesh.rest_positions)
    if (std::abs(p.x - least.x - 0.3 * (most.x - least.x)) < 0.01 && p.y > top.y) top = p;
  const Vec3f wound = to_float(
      least + Vec3d{0.7 * (most.x - least.x), 0.6 * (most.y - least.y), 0.5 * (most.z - least.z)});
  Simulation simulation(std::move(organ));
  const auto decisions = simulation.with_sweeps_for_organ({});
  PressWork work;
  const Tick pressed = 3000;
  for (Tick tick = 1; tick <= pressed + 1000; ++tick) {
    hands::TickInputs inputs;
    if (tick == 1)
      for (std::uint8_t hand = 0; hand < 2; ++hand) {
        hands::HandJoin join{.slot = {hand}};
        join.shapes[0] = {
            .radius_m = hand == 0 ? 0.001f : 0.008f, .length_m = 0.3f, .edge_m = 0.12f};
        inputs.joins.push_back(join);
      }
    const auto put = [&](std::uint8_t hand, const Vec3f& tip, tool::Verb verb) {
      inputs.samples.push_back({tool_slot({hand}, 0), {{tip, rotation_from_z({0, 1, 0})}, verb}});
    };
    if (tick % 4 == 1) {
      const float t = static_cast<float>(tick) * 1e-3f;
      if (has_wound && t < 0.8f)
        put(0, wound + Vec3f{0.05f * t - 0.02f, 0, 0}, tool::Verb::Cut);
      else
        put(0, {0, 0.5f, 0}, tool::Verb::None);
      const float turn = std::sin(3.14159f * (t - 3));
      if (tick > pressed)
        put(1, to_float(top) + Vec3f{0, 0.008f - 0.01f * turn * turn, 0}, tool::Verb::Push);
    }
    const auto& report = simulation.tick(inputs, decisions);
    if (tick <= pressed + 100) continue;
    const auto& contact = simulation.context().contact;
    work.most_active = std::max<std::size_t>(work.most_active, report.near.active_nodes);
    work.looked_at += contact.self_finder.pairs_looked_at();
    work.seeds += contact.found.self_seeds.size();
    work.pairs += simulation.state().self_contacts.nodes().size();
  }
  return work;
}

TEST(Rest, AnOldWoundFarFromAPressAddsLittleWork) {
  const auto uncut = press_beside(false), cut = press_beside(true);
  EXPECT_EQ(uncut.pairs, 0u);
  EXPECT_GT(cut.pairs, 20'000u) << "of 900 ticks";
  EXPECT_EQ(cut.seeds, 0u) << "both lips move together";
  EXPECT_LE(cut.most_active, uncut.most_active + uncut.most_active / 10);
  EXPECT_LT(cut.looked_at, cut.pairs / 8);
}

TEST(Rest, SnapshotsOfWhatSleepsAreReadAndContinuedBitForBit) {
  Wound wound;
  Random random(3);
  struct Restored {
    std::unique_ptr<Simulation> simulation;
    Tick until = 0;
  };
  std::vector<Restored> restored;
  Tick next = 300;
  int asleep = 0, with_pairs = 0;
  while (wound.simulation().current_tick() < Wound::kTouched + 200) {
    const auto inputs = wound.inputs_of(wound.simulation().current_tick() + 1);
    const auto report = wound.tick();
    for (auto& other : restored)
      ASSERT_EQ(other.simulation->tick(inputs, {}).state_hash, report.state_hash)
          << "tick " << report.tick;
    std::erase_if(restored, [&](const Restored& r) { return r.until <= report.tick; });
    if (report.tick < next) continue;
    next = report.tick + 1 + random.below(90);
    Bytes bytes;
    wound.simulation().write_snapshot(bytes);
    auto other = std::make_unique<Simulation>(wound.simulation().beside());
    ASSERT_TRUE(other->restore_snapshot(bytes).ok());
    ASSERT_EQ(other->state_hash(), wound.simulation().state_hash());
    restored.push_back({std::move(other), report.tick + 20 + random.below(200)});
    const bool is_asleep = report.solve.node_sweeps == 0;
    asleep += is_asleep;
    with_pairs += is_asleep && !wound.simulation().state().self_contacts.nodes().empty();
  }
  EXPECT_GT(asleep, 3);
  EXPECT_GT(with_pairs, 3);
}

}  // namespace
}  // namespace trocar::step
