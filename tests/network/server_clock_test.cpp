#include "client/net/server_clock.h"

#include <gtest/gtest.h>

#include <random>

namespace trocar::net {
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

}  // namespace
}  // namespace trocar::net
