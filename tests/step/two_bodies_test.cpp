// Two bodies in one organ: a chest wall and the heart under it.

#include <gtest/gtest.h>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/cutting/validate.h"
#include "server/tissue/step/simulation.h"

namespace trocar::step {
namespace {

class TwoBodies : public ::testing::Test {
 protected:
  TwoBodies() : simulation_(catalogue::make_chest()) {
    const auto& organ = simulation_.organ();
    const auto& rest = organ.mesh.rest_positions;
    for (const auto& p : rest) top_ = std::max(top_, static_cast<float>(p.y));
    is_heart_.resize(rest.size());
    for (const auto node : organ.regions[0].nodes) is_heart_[node.value] = 1;
    for (const auto node : organ.regions[0].nodes)
      if (!apex_.is_valid() || rest[node.value].y > rest[apex_.value].y) apex_ = node;
    for (std::uint32_t n = 0; n < rest.size(); ++n)
      if (is_heart_[n] == 0 && (!above_.is_valid() || distance(n) < distance(above_.value)))
        above_ = NodeIndex(n);
  }

  double distance(std::uint32_t node) const {
    const auto& rest = simulation_.organ().mesh.rest_positions;
    return length(rest[node] - rest[apex_.value]);
  }
  float height(NodeIndex node) const {
    return static_cast<float>(simulation_.organ().mesh.rest_positions[node.value].y) +
           simulation_.state().world.displacements[node.value].y;
  }
  Vec3f over_apex(float above_top) const {
    const auto& p = simulation_.organ().mesh.rest_positions[apex_.value];
    return {static_cast<float>(p.x), top_ + above_top, static_cast<float>(p.z)};
  }

  Simulation simulation_;
  std::vector<std::uint8_t> is_heart_;
  float top_ = -1;
  NodeIndex apex_, above_;  // the heart's uppermost node, the wall's nearest to it
};

TEST_F(TwoBodies, WhatPressesTheWallPressesTheHeart) {
  hands::TickInputs inputs;
  hands::HandJoin join{.slot = {0}};
  join.shapes[0] = {.radius_m = 0.04f, .length_m = 0.3f};
  inputs.joins.push_back(join);
  const float gap = height(above_) - height(apex_), heart = height(apex_);
  EXPECT_NEAR(gap, 0.004f, 0.001f);
  for (int tick = 1; tick <= 600; ++tick) {
    const float depth = std::min(0.03f, 0.1f * static_cast<float>(tick) * 1e-3f);
    inputs.samples.push_back(
        {tool_slot({0}, 0),
         {{over_apex(0.002f - depth), rotation_from_z({0, 1, 0})}, tool::Verb::Push}});
    ASSERT_EQ(simulation_.tick(inputs, {}).solve.nodes_rejected, 0u) << "tick " << tick;
    inputs.clear();
  }
  EXPECT_LT(height(apex_), heart - 0.002f) << "the heart gives way";
  EXPECT_GT(height(above_), height(apex_) - 0.001f) << "and is not entered";
}

TEST_F(TwoBodies, ABladeCutsTheOneAndLeavesTheOther) {
  hands::TickInputs inputs;
  hands::HandJoin join{.slot = {0}};
  join.shapes[0] = {.radius_m = 0.001f, .length_m = 0.3f, .edge_m = 0.08f};
  inputs.joins.push_back(join);
  double opened = 0;
  for (int tick = 1; tick <= 700; ++tick) {
    const float along = 0.1f * static_cast<float>(tick) * 1e-3f - 0.035f;
    inputs.samples.push_back(
        {tool_slot({0}, 0),
         {{over_apex(-0.05f) + Vec3f{along, 0, 0}, rotation_from_z({0, 1, 0})}, tool::Verb::Cut}});
    const auto report = simulation_.tick(inputs, {});
    ASSERT_EQ(report.solve.nodes_rejected, 0u) << "tick " << tick;
    opened += report.cut.opened_area_m2;
    inputs.clear();
  }
  EXPECT_GT(opened, 0.05 * 0.05);
  const auto& topology = simulation_.state().cuts.topology();
  const auto valid = cutting::validate(topology);
  EXPECT_TRUE(valid.ok()) << valid.error().message;
  EXPECT_EQ(cutting::find_pieces(topology).count, 2u);
  const auto& mesh = simulation_.organ().mesh;
  for (std::uint32_t t = 0; t < mesh.tets.size(); ++t)
    if (is_heart_[mesh.tets[t][0].value] != 0) {
      ASSERT_EQ(topology.tet(TetIndex(t)), mesh.tets[t]) << "the heart is whole";
    }
}

}  // namespace
}  // namespace trocar::step
