// Knots: what is tied stays tied, and equal pulls give equal bits.

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/thread/seeded_pulls.h"

namespace trocar::thread {
namespace {

TEST(Knots, CrossingsAreKeptUnderSeededPulls) {
  testing::Random random(51);
  for (std::size_t k = 0; k < 3; ++k) expect_kept(kKnots[k], random, 120);
}

TEST(Knots, EqualPullsGiveEqualBitsAlsoFromASnapshot) {
  KnotInHands one({{3, 1}, {3, -1}}, 0.2), two({{3, 1}, {3, -1}}, 0.2);
  for (int k = 0; k < 100; ++k) {
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
  for (int k = 0; k < 40; ++k) {
    one.pull(0.1);
    three.pull(0.1);
    ASSERT_EQ(one.laid.hash(), three.laid.hash()) << "tick " << k;
  }
}

TEST(Knots, AHalfKnotWithFrictionHoldsBack) {
  KnotInHands rough({{3, 1}}, 0.2), smooth({{3, 1}}, 0);
  for (auto* knot : {&rough, &smooth})
    for (int k = 0; k < 300; ++k) knot->pull(knot->force_n() < 2 ? 0.05 : 0);
  EXPECT_LT(rough.loop_n(), 0.8 * smooth.loop_n());
  EXPECT_NEAR(smooth.loop_n() / (2 * smooth.force_n()), 1, 0.1);
}

}  // namespace
}  // namespace trocar::thread
