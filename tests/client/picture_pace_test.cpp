#include "client/app/picture_pace.h"

#include <gtest/gtest.h>

namespace trocar::app {
namespace {

constexpr std::uint64_t kMs = 1'000'000;

// Draws pictures that take `took_ms` each for a second; how many there were.
int pictures_in_a_second(PicturePace pace, std::uint64_t took_ms) {
  int count = 0;
  for (std::uint64_t now = 0; now < 1000 * kMs; now = std::max(now, pace.next_ns())) {
    EXPECT_TRUE(pace.is_due(now));
    pace.note_picture(now, now + took_ms * kMs);
    now += took_ms * kMs;
    ++count;
  }
  return count;
}

PicturePace yielding(double rate) {
  PicturePace pace(rate);
  pace.yield();
  return pace;
}

TEST(PicturePace, KeepsTheRateOfQuickPicturesAndHurriesWithSlowOnes) {
  EXPECT_NEAR(pictures_in_a_second(PicturePace(50), 2), 50, 1);
  EXPECT_NEAR(pictures_in_a_second(PicturePace(50), 40), 25, 1);
}

TEST(PicturePace, YieldingRestsAsLongAsItDraws) {
  EXPECT_NEAR(pictures_in_a_second(yielding(60), 2), 60, 1) << "there is rest enough";
  EXPECT_NEAR(pictures_in_a_second(yielding(60), 20), 25, 1) << "half of the time";
}

TEST(PicturePace, YieldingKeepsTwentyPicturesASecondWhereItCan) {
  EXPECT_NEAR(pictures_in_a_second(yielding(60), 35), 20, 1);
  EXPECT_NEAR(pictures_in_a_second(yielding(60), 100), 10, 1);
  EXPECT_NEAR(pictures_in_a_second(yielding(15), 20), 15, 1) << "fewer are asked for";
}

float fineness_after(PicturePace pace, int pictures, std::uint64_t took_ms) {
  for (int i = 0; i < pictures; ++i) pace.note_picture(0, took_ms * kMs);
  return pace.fineness();
}

TEST(PicturePace, SlowPicturesGetFewerPixels) {
  EXPECT_EQ(fineness_after(yielding(60), 500, 90), 1);
  EXPECT_EQ(fineness_after(yielding(60), 20, 300), 1) << "a moment is no reason";
  const float coarser = fineness_after(yielding(60), 24, 200);
  EXPECT_LT(coarser, 1);
  EXPECT_LT(fineness_after(yielding(60), 48, 200), coarser);
  EXPECT_GE(fineness_after(yielding(60), 1000, 900), 0.5f) << "it stays a picture";
  EXPECT_EQ(fineness_after(PicturePace(60), 1000, 900), 1) << "a graphics processor draws all";
}

}  // namespace
}  // namespace trocar::app
