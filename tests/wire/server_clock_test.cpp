#include "common/wire/server_clock.h"

#include <gtest/gtest.h>

#include <random>

namespace trocar::wire {
namespace {

TEST(ServerClock, TheShortestRoundTripTellsAndLaterPingsOnlySlew) {
  constexpr double kOffsetUs = 5e6;
  std::mt19937 random(2);
  std::exponential_distribution<> queue(1 / 10'000.0);  // us
  ServerClock clock;
  EXPECT_FALSE(clock.is_known());
  double last = 0;
  for (int i = 0; i < 200; ++i) {
    const auto sent = static_cast<std::uint64_t>(1'000'000 + 200'000 * i);
    const double up = 10'000 + queue(random), down = 10'000 + queue(random);
    clock.add(sent, static_cast<std::uint64_t>(static_cast<double>(sent) + up + kOffsetUs),
              sent + static_cast<std::uint64_t>(up + down));
    if (i > static_cast<int>(ServerClock::kSamples)) {
      EXPECT_LE(std::abs(clock.offset_us() - last), 200'000 * ServerClock::kSlewPerSecond * 1.5);
      EXPECT_NEAR(clock.offset_us(), kOffsetUs, 6000);
    }
    last = clock.offset_us();
  }
  EXPECT_LT(clock.shortest_round_trip_us(), 35'000);
}

TEST(ServerClock, TellsTheTimeThere) {
  ServerClock clock;
  EXPECT_EQ(clock.at(1000), 0u);
  clock.add(1000, 5050, 1100);  // there and back in 100: 5050 was when it was 1050 here
  EXPECT_EQ(clock.at(2000), 6000u);
  clock.add(2000, 6500, 4000);  // slow, and off by 500
  EXPECT_EQ(clock.at(2000), 6000u);
  clock.add(5000, 1, 4000);  // cannot be
  clock.add(5000, 0, 5001);  // not known there
  EXPECT_EQ(clock.at(2000), 6000u);
}

}  // namespace
}  // namespace trocar::wire
