// Hands that do what no hand does. Nobody else may feel it.

#include <gtest/gtest.h>

#include "tests/contact/scene_fixture.h"
#include "tests/support/random.h"

namespace trocar::contact::testing {
namespace {

using trocar::testing::Random;

using tool::Verb;

class SecondHand : public ::testing::Test {
 protected:
  SecondHand() : organ(block(12, 4, 6, 0.010)), top(top_of(organ)), scene(organ) {
    scene.join(0, {.radius_m = 0.010f, .length_m = 0.1f});
    scene.join(1, {.radius_m = 0.006f, .length_m = 0.1f});
    scene.hold(0, held, 8);
    scene.hold(0, held, 2000);
    before = scene.reaction(0).force_n;
  }
  // Runs while another hand does something; returns the greatest change of the first one's force.
  template <typename Other>
  float largest_change(int ticks, Other&& other) {
    float most = 0;
    for (int i = 0; i < ticks; ++i) {
      if (i % 8 == 0) scene.put(0, held);
      other(i);
      scene.tick();
      most = std::max(most, length(scene.reaction(0).force_n - before));
    }
    return most;
  }

  organ::Organ organ;
  float top;
  HandScene scene;
  const Pose held = upright({-0.035f, top_of(organ) - 0.003f, 0.002f});
  Vec3f before;
};

TEST_F(SecondHand, ThatTeleportsThroughTheOrganMovesNothing) {
  ASSERT_GT(length(before), 0.02f);
  Random random(7);
  const float change = largest_change(2000, [&](int i) {
    if (i % 8 != 0) return;
    const auto far = [&] { return static_cast<float>(random.unit() * 2 - 1); };
    scene.put(1, upright({far(), far(), far()}));
  });
  EXPECT_LT(change, 0.02f * length(before));
}

TEST_F(SecondHand, ThatStartsInsideTouchesNothingUntilItIsOut) {
  const float change = largest_change(800, [&](int i) {
    if (i % 8 == 0) scene.put(1, {{0.03f, -0.010f, 0}, rotation_from_z({0, 1, 0})});
  });
  EXPECT_LT(change, 0.005f * length(before));
  EXPECT_LT(length(scene.reaction(1).force_n), 1e-3f);
  // Out at the top, and back in: now it presses.
  largest_change(400, [&](int i) {
    if (i % 8 == 0) scene.put(1, upright({0.03f, top + 0.003f, 0}));
  });
  largest_change(400, [&](int i) {
    if (i % 8 == 0) scene.put(1, upright({0.03f, top - 0.003f, 0}));
  });
  EXPECT_GT(scene.reaction(1).force_n.y, 0.02f);
}

TEST_F(SecondHand, ThatChangesItsVerbEveryTickIsBoundedWork) {
  std::size_t most = 0;
  const float change = largest_change(1000, [&](int i) {
    const Verb verbs[] = {Verb::None, Verb::Push, Verb::Grasp};
    scene.put(1, upright({0.035f, top - 0.001f, 0}), verbs[i % 3]);
    most = std::max(most, scene.simulation.context().contact.finder.triangles_visited());
  });
  EXPECT_LT(change, 0.02f * length(before));
  EXPECT_LE(most, 2 * organ.mesh.boundary_triangles.size());
}

}  // namespace
}  // namespace trocar::contact::testing
