// A grasp holds a patch, slips at its force, and lets go what has left the jaws.

#include <gtest/gtest.h>

#include "tests/contact/scene_fixture.h"

namespace trocar::contact::testing {
namespace {

using hands::ClaimPhase;
using tool::Verb;

struct Pulled {
  float most_n = 0;       // greatest force on the tool
  int slipped_tick = -1;  // its claim was spent
  std::size_t taken = 0;  // nodes at the start
};

// Takes hold of a stiff block's top and pulls up at 20 mm/s.
Pulled pull(float grip_n, HandScene& scene, float top) {
  scene.join(0, {.radius_m = 0.004f, .reach_m = 0.012f, .grip_n = grip_n});
  scene.hold(0, upright({0, top, 0}), 40, Verb::Grasp);
  Pulled result{.taken = scene.simulation.state().grasps[ToolSlot{0}].nodes.size()};
  for (int i = 0; i < 1500; ++i) {
    if (i % 8 == 0) scene.put(0, upright({0, top + 2e-5f * static_cast<float>(i), 0}), Verb::Grasp);
    scene.tick();
    result.most_n = std::max(result.most_n, length(scene.reaction(0).force_n));
    if (scene.simulation.state().claims.claim(ToolSlot{0}).phase == ClaimPhase::Spent) {
      result.slipped_tick = i;
      break;
    }
  }
  return result;
}

organ::Organ stiff_block() {
  return block(6, 4, 6, 0.008, [](organ::Organ& o) { o.material.young_modulus_pa = 40'000; });
}

TEST(Grasp, TissuePulledHarderThanTheGripSlipsOutAndIsNotTakenAgain) {
  const auto organ = stiff_block();
  const float top = top_of(organ);
  HandScene scene(organ);
  const auto pulled = pull(1.5f, scene, top);
  EXPECT_GE(pulled.taken, 4u) << "a patch, not a node";
  ASSERT_GT(pulled.slipped_tick, 0);
  EXPECT_NEAR(pulled.most_n, 1.5f, 0.05f * 1.5f);
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
    EXPECT_FALSE(scene.simulation.state().claims.owner(NodeIndex(n)).is_valid());
  // Jaws that are still closed take no hold, even on the tissue.
  scene.hold(0, upright({0, top, 0}), 400, Verb::Grasp);
  EXPECT_EQ(length(scene.reaction(0).force_n), 0);
  scene.hold(0, upright({0, top, 0}), 40, Verb::None);
  scene.hold(0, upright({0, top, 0}), 40, Verb::Grasp);
  EXPECT_EQ(scene.simulation.state().claims.claim(ToolSlot{0}).phase, ClaimPhase::Held);
}

TEST(Grasp, AFirmGripHoldsAsFarAsTheHandGoes) {
  const auto organ = stiff_block();
  const float top = top_of(organ);
  HandScene scene(organ);
  const auto pulled = pull(100, scene, top);
  EXPECT_EQ(pulled.slipped_tick, -1);
  EXPECT_GT(pulled.most_n, 5);
  EXPECT_EQ(scene.simulation.state().grasps[ToolSlot{0}].nodes.size(), pulled.taken);
}

TEST(Grasp, JawsCloseAndSqueezeWhatLiesBetweenThem) {
  const auto organ = block(6, 4, 6, 0.008);
  const float top = top_of(organ);
  HandScene scene(organ);
  scene.join(0, {.radius_m = 0.004f, .reach_m = 0.012f});
  const Pose pose = upright({0, top, 0});
  scene.hold(0, pose, 16, Verb::Grasp);
  const auto& grasp = scene.simulation.state().grasps[ToolSlot{0}];
  ASSERT_FALSE(grasp.nodes.empty());
  const auto width = [&] {
    float least = 1, most = -1;
    for (const auto node : grasp.nodes) {
      const float x = pose.apply_inverse(scene.world().position(node)).x;
      least = std::min(least, x), most = std::max(most, x);
    }
    return most - least;
  };
  const float open = width();
  scene.hold(0, pose, 400, Verb::Grasp);
  EXPECT_EQ(grasp.closed, 1);
  // While they close, what is pulled hardest slips a little.
  EXPECT_NEAR(width(), (1 - kSqueeze) * open, 0.1f * open);
}

TEST(Grasp, TwoHandsPullOneFlapAndTheirForcesBalanceWhatHoldsIt) {
  // A strip fixed at its far end: the pull of both arrives there.
  auto organ = block(4, 13, 4, 0.008);
  const float top = top_of(organ);
  HandScene scene(organ);
  scene.decisions.sweeps = 8;
  scene.decisions.depth_limit = 40;
  for (const auto hand : kHands) scene.join(hand, {.radius_m = 0.004f, .reach_m = 0.009f});
  const auto at = [&](std::uint8_t hand, float up) {
    return upright({0, top + up, hand == 0 ? -0.012f : 0.012f});
  };
  for (int i = 0; i < 4000; ++i) {
    if (i % 8 == 0)
      for (const auto hand : kHands)
        scene.put(hand, at(hand, 0.012f * std::min(1.0f, static_cast<float>(i) / 1500.0f)),
                  Verb::Grasp);
    scene.tick();
  }
  const float both = scene.reaction(0).force_n.y + scene.reaction(1).force_n.y;
  EXPECT_LT(scene.reaction(0).force_n.y, -0.02f);
  EXPECT_LT(scene.reaction(1).force_n.y, -0.02f);
  // The slope of the energy over its height is what holds the fixed layer in place.
  const auto energy_at = [&](double height) {
    auto displacements = scene.world().displacements;
    for (const auto node : organ.fixed_nodes)
      displacements[node.value].y += static_cast<float>(height);
    return scene.simulation.context().solve.solver.tissue().energy_j(displacements);
  };
  const double h = 1e-5, held = (energy_at(h) - energy_at(-h)) / (2 * h);
  EXPECT_NEAR(held, static_cast<double>(both), 0.02 * std::abs(static_cast<double>(both)));
}

}  // namespace
}  // namespace trocar::contact::testing
