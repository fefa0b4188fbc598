#pragma once

// Knots that two hands pull at from a seed, at 0.05 to 1 m/s: their crossings are kept.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/random.h"
#include "tests/thread/laid_thread.h"

namespace trocar::thread {

struct NamedKnot {
  const char* name;
  std::vector<Throw> throws;
};
inline const std::vector<NamedKnot> kKnots{{"half", {{3, 1}}},
                                           {"square", {{3, 1}, {3, -1}}},
                                           {"granny", {{3, 1}, {3, 1}}},
                                           {"double", {{5, 1}}},
                                           {"surgeon's", {{5, 1}, {3, -1}}},
                                           {"three throws", {{3, 1}, {3, -1}, {3, 1}}}};

inline void expect_kept(const NamedKnot& named, testing::Random& random, int ticks) {
  KnotInHands knot(named.throws, 0.2);
  const int before = knot.signed_crossings();
  const double speed = 0.05 * std::pow(20.0, random.unit());
  const auto any = [&] { return random.between(-0.3, 0.3); };
  const Vec3d aside{any(), any(), any()};
  for (int k = 0; k < ticks; ++k) {
    const double slower = std::clamp(1.2 - knot.force_n() / 3, 0.0, 1.0);  // as hands are
    EXPECT_FALSE(knot.pull(speed * slower, aside).is_restored);
  }
  const auto presses = [](double n) { return n > 0; };
  EXPECT_GT(std::ranges::count_if(knot.laid.threads.pairs.press_n, presses), 2) << named.name;
  EXPECT_EQ(knot.signed_crossings(), before) << named.name << " at " << speed << " m/s";
}

}  // namespace trocar::thread
