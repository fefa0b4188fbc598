// laws_test.cpp with a thousand scenes.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "tests/step/laws.h"

namespace trocar::step::testing {
namespace {

TEST(LawsCampaign, HoldInAThousandScenes) {
  LawFigures worst;
  int held_inverted = 0;
  for (int n = 0; n < 1000; ++n) {
    const auto scene = run_law_scene(n);
    EXPECT_EQ(broken_laws(scene.figures), "") << scene.name;
    const auto& figures = scene.figures;
    worst.speed = std::max(worst.speed, figures.speed);
    worst.inverted_ticks = std::max(worst.inverted_ticks, figures.inverted_ticks);
    worst.inverted_held_ticks = std::max(worst.inverted_held_ticks, figures.inverted_held_ticks);
    worst.growth = std::max(worst.growth, figures.growth);
    worst.drift_m_s = std::max(worst.drift_m_s, figures.drift_m_s);
    held_inverted += figures.inverted_held_ticks > 100 ? 1 : 0;
  }
  std::printf(
      "worst: %.2f of the speed that may be, energy grew by %.4f, the middle is %.5f m/s faster, "
      "inside out for %d ticks without tools and for %d with them (in %d scenes for more than "
      "100)\n",
      worst.speed, worst.growth, worst.drift_m_s, worst.inverted_ticks, worst.inverted_held_ticks,
      held_inverted);
}

}  // namespace
}  // namespace trocar::step::testing
