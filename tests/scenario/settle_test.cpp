// A settled organ is in equilibrium where it is: it does not move when it starts.

#include "server/lab/scenario/settle.h"

#include <gtest/gtest.h>

#include <array>

#include "server/lab/scenario/scenario_block.h"
#include "server/lab/scenario/scenario_run.h"

namespace trocar::scenario {
namespace {

constexpr Vec3d kGravity{0, -9.81, 0};

organ::Organ block() {
  auto organ = scenario::make_block({5, 5, 5, 0.008});
  EXPECT_TRUE(organ.ok());
  return std::move(*organ);
}

// Tissue that relaxes, when it has hung for long.
organ::Organ measured_block(bool is_averaged) {
  auto organ = block();
  auto material = *material::find_measured_material("human_liver_nava2008");
  material.relaxation = {{0.5, 0.05}, {0.2, 0.5}};  // soon
  material::use_measured(material, organ.material);
  organ.material.has_averaged_strain = is_averaged;
  return organ;
}

class SettleAny : public ::testing::TestWithParam<organ::Organ (*)()> {};

TEST_P(SettleAny, TheRestPoseIsInEquilibriumAndTheOldOneIsFreeOfStress) {
  const auto organ = GetParam()();
  const auto settled = settle(organ, kGravity);
  ASSERT_TRUE(settled.ok()) << settled.error().message;
  EXPECT_GT(settled->largest_move_m, 0.5e-3) << "otherwise this test shows nothing";
  EXPECT_LE(settled->residual_n, 1e-6f);
  const auto& after = settled->organ;
  EXPECT_TRUE(organ::validate(after).ok());
  EXPECT_EQ(after.gravity_m_s2, kGravity);
  EXPECT_EQ(after.mesh.tets, organ.mesh.tets);
  EXPECT_EQ(after.node_masses_kg, organ.node_masses_kg);
  // The old rest pose, moved as a whole with the centre of the bounding box.
  const Vec3d shift = after.stress_free_positions_m[0] - organ.mesh.rest_positions[0];
  for (std::size_t i = 0; i < organ.mesh.node_count(); ++i)
    ASSERT_LT(length(after.stress_free_positions_m[i] - organ.mesh.rest_positions[i] - shift),
              1e-12);
  // Fixed nodes stay where they are in the source's coordinates.
  for (const auto node : organ.fixed_nodes)
    EXPECT_LT(length(after.mesh.rest_positions[node.value] + after.source_offset_m -
                     organ.mesh.rest_positions[node.value] - organ.source_offset_m),
              1e-12);

  scenario::ResolvedScenario resolved;
  resolved.organ = after;
  resolved.scenario.run.seconds = 0.3;
  ScenarioRun run(std::move(resolved), Solver::Live);
  while (!run.is_finished()) run.step();
  float farthest = 0;
  for (const auto& u : run.world().displacements) farthest = std::max(farthest, length(u));
  EXPECT_LT(farthest, 0.01 * settled->largest_move_m);
}

std::string name_of(const ::testing::TestParamInfo<organ::Organ (*)()>& tested) {
  constexpr std::array<const char*, 3> kNames{"Springs", "Measured", "MeasuredAveraged"};
  return kNames[tested.index];
}

INSTANTIATE_TEST_SUITE_P(, SettleAny,
                         ::testing::Values(
                             block, +[] { return measured_block(false); },
                             +[] { return measured_block(true); }),
                         name_of);

// Settling finds the state to which tissue creeps.
TEST(Settle, TissueThatRelaxesIsWhereItCreepsTo) {
  const auto organ = measured_block(false);
  const auto settled = settle(organ, kGravity);
  ASSERT_TRUE(settled.ok()) << settled.error().message;
  scenario::ResolvedScenario resolved;
  resolved.organ = organ;
  resolved.organ.gravity_m_s2 = kGravity;
  resolved.scenario.run.seconds = 12;
  ScenarioRun run(std::move(resolved), Solver::Live);
  float soon = 0;
  while (!run.is_finished()) {
    run.step();
    if (run.steps_done() == 50)
      for (const auto& u : run.world().displacements) soon = std::max(soon, length(u));
  }
  float late = 0;
  for (const auto& u : run.world().displacements) late = std::max(late, length(u));
  EXPECT_NEAR(late, settled->largest_move_m, 0.01 * settled->largest_move_m);
  EXPECT_LT(soon, 0.8f * late);
}

TEST(Settle, SettlingTwiceKeepsTheFirstStressFreePose) {
  const auto once = settle(block(), kGravity);
  ASSERT_TRUE(once.ok());
  const auto twice = settle(once->organ, kGravity);
  ASSERT_TRUE(twice.ok());
  EXPECT_LT(twice->largest_move_m, 1e-5);
  const auto released = settle(once->organ, {0, 0, 0});
  ASSERT_TRUE(released.ok());
  const auto& organ = released->organ;
  for (std::size_t i = 0; i < organ.mesh.node_count(); ++i)
    ASSERT_LT(length(organ.mesh.rest_positions[i] - organ.stress_free_positions_m[i]), 2e-5)
        << "without gravity it is where it is free of stress";
}

TEST(Settle, WhatHasNoEquilibriumIsSaid) {
  auto organ = block();
  organ.fixed_nodes.clear();
  const auto falling = settle(organ, kGravity);
  ASSERT_FALSE(falling.ok());
  EXPECT_NE(falling.error().message.find("nothing holds it"), std::string::npos);
  organ = block();
  organ.material.young_modulus_pa = 50;
  const auto soft = settle(organ, kGravity);
  ASSERT_FALSE(soft.ok());
  EXPECT_EQ(soft.error().message.find('\n'), std::string::npos);
}

}  // namespace
}  // namespace trocar::scenario
