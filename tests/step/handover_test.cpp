// Two hands change instruments: what one of them holds is never let go, and the state goes on from
// there as any other does.

#include <gtest/gtest.h>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/simulation.h"

namespace trocar::step {
namespace {

constexpr ToolSlot kGiver{0}, kReceiver{2};
constexpr Tick kHandover = 400;

organ::Organ liver() {
  auto organ = *catalogue::make_liver(4000);
  organ.material.elastic_law = material::ElasticLaw::NeoHookean;
  return organ;
}

// The giver lifts the end of a lobe; the receiver's hand is 20 cm away. From kHandover on the
// receiver holds still what the giver has lifted.
class Handover : public ::testing::Test {
 protected:
  Handover() {
    for (const auto& p : simulation_.organ().mesh.rest_positions)
      if (static_cast<float>(p.x) > end_.x) end_ = to_float(p);
  }
  Pose lifted() const { return {end_ + Vec3f{0, 0.008f, 0}, rotation_from_z({1, 0, 0})}; }
  hands::TickInputs inputs_of(Tick tick, tool::Verb givers = tool::Verb::Grasp) const {
    hands::TickInputs inputs;
    if (tick == 1)
      for (std::uint8_t hand = 0; hand < 2; ++hand) {
        hands::HandJoin join{.slot = {hand}};
        join.shapes[0] = {.radius_m = hand == 0 ? 0.002f : 0.003f,
                          .length_m = 0.3f,
                          .reach_m = 0.012f,
                          .edge_m = 0.02f};
        inputs.joins.push_back(join);
      }
    if (tick == kHandover) inputs.handover = hands::Handover{kGiver, kReceiver};
    if (tick % 8 != 1) return inputs;
    const Pose far{end_ + Vec3f{0.2f, 0, 0}, rotation_from_z({1, 0, 0})};
    Pose held = lifted();
    held.position.y = end_.y + std::min(0.008f, 0.00004f * static_cast<float>(tick));
    const bool is_over = tick > kHandover;
    inputs.samples.push_back({kGiver, {is_over ? far : held, is_over ? tool::Verb::None : givers}});
    inputs.samples.push_back(
        {kReceiver, {is_over ? held : far, is_over ? givers : tool::Verb::None}});
    return inputs;
  }
  void run_to(Tick tick, Simulation& simulation, tool::Verb givers = tool::Verb::Grasp) const {
    while (simulation.current_tick() < tick)
      simulation.tick(inputs_of(simulation.current_tick() + 1, givers), {});
  }

  Simulation simulation_{liver()};
  Vec3f end_{-1, 0, 0};
};

TEST_F(Handover, TheTissueIsHeldByTheOtherHandInTheSameTick) {
  run_to(kHandover - 1, simulation_);
  const auto nodes = simulation_.state().grasps[kGiver].nodes;
  ASSERT_FALSE(nodes.empty());
  const auto before = simulation_.state().world.displacements;
  const auto pose = simulation_.state().tools[kGiver].pose;
  run_to(kHandover, simulation_);
  const auto& state = simulation_.state();
  EXPECT_TRUE(state.grasps[kGiver].nodes.empty());
  EXPECT_EQ(state.grasps[kReceiver].nodes, nodes);
  EXPECT_EQ(state.tools[kReceiver].pose, pose);
  EXPECT_EQ(state.tools[kReceiver].shape.radius_m, 0.002f);
  EXPECT_EQ(state.tools[kGiver].shape.radius_m, 0.003f);
  for (const auto node : nodes) EXPECT_EQ(state.claims.owner(node), kReceiver);
  EXPECT_TRUE(state.claims.is_in_effect(kReceiver));
  // The grasp has stood still for the last 200 ticks, so tissue has no reason to move.
  for (std::size_t n = 0; n < before.size(); ++n)
    ASSERT_LT(length(state.world.displacements[n] - before[n]), 1e-4f);
  run_to(kHandover + 1000, simulation_);
  EXPECT_EQ(simulation_.state().grasps[kReceiver].nodes, nodes) << "the lease is the new hand's";
}

TEST_F(Handover, TheNewHandLetsGoAsAnyHandDoes) {
  run_to(kHandover + 4, simulation_);
  hands::TickInputs inputs;
  inputs.samples.push_back({kReceiver, {lifted(), tool::Verb::None}});
  simulation_.tick(inputs, {});
  EXPECT_FALSE(simulation_.state().claims.is_in_effect(kReceiver));
  EXPECT_TRUE(simulation_.state().grasps[kReceiver].nodes.empty());
}

TEST_F(Handover, WhatTheGiverDoesAfterwardsIsNothingToTheTissue) {
  run_to(kHandover + 4, simulation_);
  const auto nodes = simulation_.state().grasps[kReceiver].nodes;
  hands::TickInputs inputs;
  inputs.leaves.push_back(kGiver.owner());
  simulation_.tick(inputs, {});
  EXPECT_EQ(simulation_.state().grasps[kReceiver].nodes, nodes);
  EXPECT_EQ(simulation_.state().claims.claim(kReceiver).phase, hands::ClaimPhase::Held);
}

TEST_F(Handover, ARestoredStateGoesOnToTheSameHash) {
  run_to(kHandover, simulation_);
  Bytes snapshot;
  simulation_.write_snapshot(snapshot);
  Simulation other(liver());
  ASSERT_TRUE(other.restore_snapshot(snapshot).ok());
  run_to(kHandover + 300, simulation_);
  run_to(kHandover + 300, other);
  EXPECT_EQ(simulation_.state_hash(), other.state_hash());
}

TEST_F(Handover, ABladeIsLifted) {
  run_to(kHandover, simulation_, tool::Verb::Cut);
  const auto& state = simulation_.state();
  for (const auto tool : {kGiver, kReceiver}) {
    EXPECT_NE(state.claims.claim(tool).verb, tool::Verb::Cut);
    EXPECT_EQ(state.tools[tool].verb, tool::Verb::None);
  }
}

TEST_F(Handover, WithinAHandOrToNobodyIsDropped) {
  run_to(20, simulation_);
  const auto hash = [](Simulation& simulation) { return simulation.state_hash(); };
  Simulation other(liver());
  run_to(20, other);
  for (const auto& wrong : {hands::Handover{kGiver, {1}}, hands::Handover{kGiver, {4}},
                            hands::Handover{{5}, kReceiver}, hands::Handover{kGiver, {}}}) {
    hands::TickInputs inputs;
    inputs.handover = wrong;
    EXPECT_EQ(simulation_.tick(inputs, {}).inputs_dropped, 1u);
    other.tick({}, {});
    EXPECT_EQ(hash(simulation_), hash(other));
  }
}

}  // namespace
}  // namespace trocar::step
