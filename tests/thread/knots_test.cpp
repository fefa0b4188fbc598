// Knots: what is tied stays tied, and equal pulls give equal bits.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/random.h"
#include "tests/thread/laid_thread.h"

namespace trocar::thread {
namespace {

struct Named {
  const char* name;
  std::vector<Throw> throws;
};
const std::vector<Named> kKnots{{"half", {{3, 1}}},
                                {"double", {{5, 1}}},
                                {"granny", {{3, 1}, {3, 1}}},
                                {"square", {{3, 1}, {3, -1}}},
                                {"surgeon's", {{5, 1}, {3, -1}}}};

TEST(Knots, CrossingsAreKeptUnderSeededPulls) {
  testing::Random random(51);
  for (const auto& [name, throws] : kKnots)
    for (int run = 0; run < 1; ++run) {
      KnotInHands knot(throws, 0.2);
      const int before = knot.signed_crossings();
      const double speed = 0.05 * std::pow(20.0, random.unit());
      const Vec3d aside{random.between(-0.3, 0.3), random.between(-0.3, 0.3),
                        random.between(-0.3, 0.3)};
      for (int k = 0; k < 150; ++k) {
        const double slower = std::clamp(1.2 - knot.force_n() / 3, 0.0, 1.0);  // as hands are
        const auto report = knot.pull(speed * slower, aside);
        EXPECT_FALSE(report.is_restored);
      }
      EXPECT_GT(
          std::ranges::count_if(knot.laid.threads.pairs.press_n, [](double n) { return n > 0; }), 2)
          << name;
      EXPECT_EQ(knot.signed_crossings(), before) << name << " at " << speed << " m/s";
    }
}

TEST(Knots, EqualPullsGiveEqualBitsAlsoFromASnapshot) {
  KnotInHands one({{3, 1}, {3, -1}}, 0.2), two({{3, 1}, {3, -1}}, 0.2);
  for (int k = 0; k < 180; ++k) {
    one.pull(0.1);
    two.pull(0.1);
  }
  ASSERT_EQ(one.laid.hash(), two.laid.hash());
  Bytes bytes;
  auto writing = world::StateArchive::writing(bytes);
  one.laid.threads.visit_state(writing);
  KnotInHands three({{3, 1}, {3, -1}}, 0.2);
  auto reading = world::StateArchive::reading(bytes);
  three.laid.threads.visit_state(reading);
  ASSERT_TRUE(reading.ok() && reading.at_end());
  three.take_hands_of(one);
  for (int k = 0; k < 60; ++k) {
    one.pull(0.1);
    three.pull(0.1);
    ASSERT_EQ(one.laid.hash(), three.laid.hash()) << "tick " << k;
  }
}

TEST(Knots, AHalfKnotWithFrictionHoldsBack) {
  KnotInHands rough({{3, 1}}, 0.2), smooth({{3, 1}}, 0);
  for (auto* knot : {&rough, &smooth})
    for (int k = 0; k < 400; ++k) knot->pull(knot->force_n() < 2 ? 0.05 : 0);
  EXPECT_LT(rough.loop_n(), 0.8 * smooth.loop_n());
  EXPECT_NEAR(smooth.loop_n() / (2 * smooth.force_n()), 1, 0.1);
}

}  // namespace
}  // namespace trocar::thread
