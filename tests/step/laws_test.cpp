// Tests the laws with one scene of each organ in each kind of hands.

#include <gtest/gtest.h>

#include <cstdio>

#include "tests/step/laws.h"

namespace trocar::step::testing {
namespace {

constexpr int kScenes = kLawOrgans * kLawWorks;
// One wound that hands have drawn open and pressed together stays inside out. None may.
constexpr int kKnown = 1;

// At 0.2 m/s, where most went wrong once.
TEST(Laws, HoldOfAnyOrganInAnyHands) {
  int broken = 0;
  for (int n = 0; n < kScenes; ++n) {
    const auto scene = run_law_scene(3 * kScenes + n);
    const auto what = broken_laws(scene.figures);
    if (!what.empty()) std::printf("%s:%s\n", scene.name.c_str(), what.c_str());
    broken += what.empty() ? 0 : 1;
    EXPECT_LE(scene.figures.speed, 1) << scene.name;
    EXPECT_LT(scene.figures.growth, 1) << scene.name;
    EXPECT_LT(scene.figures.drift_m_s, 1e-3) << scene.name;
  }
  EXPECT_LE(broken, kKnown);
}

// Free pieces fall there, and parts of them are drawn out. Drag against the world drew them longer.
TEST(Laws, HoldOfPiecesThatFall) {
  for (const int n : {869, 899}) {
    const auto scene = run_law_scene(n);
    EXPECT_EQ(broken_laws(scene.figures), "") << scene.name;
  }
}

}  // namespace
}  // namespace trocar::step::testing
