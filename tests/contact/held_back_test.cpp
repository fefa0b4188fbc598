// Tools that are held back, so that time stays real for the others: tips go on slowly where they
// press, jaws follow their hand slowly and catch up when they may.

#include <gtest/gtest.h>

#include "server/tissue/contact/contact_finder.h"
#include "tests/contact/scene_fixture.h"

namespace trocar::contact::testing {
namespace {

using tool::Verb;

organ::Organ soft_block() {
  return block(7, 5, 7, 0.008, [](organ::Organ& o) { o.material.young_modulus_pa = 4'000; });
}

struct Pressed {
  int ticks = 0;       // in which it pressed
  float most_m = 0;    // that the tool went in one of them
  float behind_m = 0;  // its hand, at the end
};

// Presses a tip 15 mm deep and draws it out again, both at 0.5 m/s.
Pressed press_and_leave(std::uint32_t waiting_tools) {
  const auto organ = soft_block();
  const float top = top_of(organ);
  HandScene scene(organ);
  scene.decisions.waiting_tools = waiting_tools;
  scene.join(0, {.radius_m = 0.005f});
  Pressed result;
  Vec3f before;
  for (int tick = 0; tick < 150; ++tick) {
    const int down = 50 - std::abs(50 - std::min(tick, 100));
    const Pose hand = upright({0, top + 0.01f - 0.0005f * static_cast<float>(down), 0});
    scene.put(0, hand);
    scene.tick();
    const auto& proxy = scene.proxy(0);
    if (proxy.presses() && ++result.ticks > 1)
      result.most_m = std::max(result.most_m, length(proxy.pose.position - before));
    before = proxy.pose.position;
    result.behind_m = length(hand.position - before);
  }
  return result;
}

TEST(HeldBack, ATipIsSlowWhereItPressesAndFreeWhereItDoesNot) {
  const auto slow = press_and_leave(0b1), free = press_and_leave(0), others = press_and_leave(0b10);
  EXPECT_GT(slow.ticks, 20);
  EXPECT_LT(slow.most_m, 1.5f * kHeldBack_m) << "and what tissue pushes it";
  EXPECT_GT(free.most_m, 4 * kHeldBack_m);
  EXPECT_EQ(others.most_m, free.most_m);
  for (const auto& end : {slow, free}) EXPECT_LT(end.behind_m, 1e-4f) << "it has come out";
}

// Jaws hold a block's top.
class HeldBackJaws : public ::testing::Test {
 protected:
  HeldBackJaws() {
    scene.join(0, {.radius_m = 0.004f, .reach_m = 0.012f, .grip_n = 100});
    scene.hold(0, upright({0, top, 0}), 40, Verb::Grasp);
  }

  const organ::Organ organ = soft_block();
  const float top = top_of(organ);
  HandScene scene{organ};
  const Grasp& grasp = scene.simulation.state().grasps[ToolSlot{0}];
};

TEST_F(HeldBackJaws, StayWhereTheyAreWhenTheyFade) {
  scene.decisions.waiting_tools = 0b1;
  scene.hold(0, upright({0, top + 0.01f, 0}), 40, Verb::Grasp);
  ASSERT_TRUE(grasp.is_behind);
  const Pose jaws = grasp.jaws;
  scene.leave(0);
  scene.ticks(3);
  ASSERT_FALSE(grasp.nodes.empty());
  EXPECT_EQ(grasp.jaws, jaws);
}

TEST_F(HeldBackJaws, FollowSlowlyAndCatchUpAfterwards) {
  ASSERT_FALSE(grasp.nodes.empty());
  const auto lift = [&](float up_m, int ticks) {
    float most_m = 0;
    for (int i = 0; i < ticks; ++i) {
      const Vec3f before = grasp.jaws.position;
      scene.put(0, upright({0, top + up_m, 0}), Verb::Grasp);
      scene.tick();
      most_m = std::max(most_m, length(grasp.jaws.position - before));
    }
    return most_m;
  };
  const auto& tool = scene.simulation.state().tools[ToolSlot{0}];
  EXPECT_GT(lift(0.002f, 8), 2 * kHeldBack_m);
  EXPECT_EQ(grasp.jaws, tool.pose) << "hands that do not wait are followed at once";
  const float from_m = grasp.jaws.position.y;
  scene.decisions.waiting_tools = 0b1;
  EXPECT_NEAR(lift(0.010f, 40), kHeldBack_m, 1e-6f);
  EXPECT_NEAR(grasp.jaws.position.y, from_m + 40 * kHeldBack_m, 1e-5f);
  Bytes snapshot;
  scene.simulation.write_snapshot(snapshot);
  step::Simulation restored(organ);
  ASSERT_TRUE(restored.restore_snapshot(snapshot).ok());
  EXPECT_EQ(restored.state_hash(), scene.simulation.state_hash());
  scene.decisions.waiting_tools = 0;
  EXPECT_NEAR(lift(0.010f, 40), kCatchUp_m, 1e-6f);
  EXPECT_FALSE(grasp.is_behind);
  EXPECT_EQ(grasp.jaws, tool.pose);
}

}  // namespace
}  // namespace trocar::contact::testing
