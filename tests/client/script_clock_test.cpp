#include "client/app/script_clock.h"

#include <gtest/gtest.h>

namespace trocar::app {
namespace {

constexpr std::uint64_t kNsPerMs = 1'000'000;

// Frames from `begin` on come every `apart_ns` of real time; how far a script is off them at most,
// a millisecond at a time, once it has seen a second's frames.
double worst_error_s(ScriptClock& clock, Tick begin, std::uint64_t apart_ns) {
  double worst_s = 0, last_s = 0;
  for (Frame frame = 0; frame < 120; ++frame)
    for (std::uint64_t since = 0; since < apart_ns; since += kNsPerMs) {
      const std::uint64_t arrival = 5 * kNsPerMs + frame * apart_ns;
      const Tick tick = begin + frame * kTicksPerFrame;
      const double now_s = clock.seconds(tick, arrival, arrival + since);
      EXPECT_GE(now_s, last_s);
      last_s = now_s;
      const double right_s = 1e-3 * static_cast<double>(kTicksPerFrame) *
                             (frame + static_cast<double>(since) / static_cast<double>(apart_ns));
      if (frame > 60) worst_s = std::max(worst_s, std::abs(now_s - right_s));
    }
  return worst_s;
}

TEST(ScriptClock, GoesByTheTicksOfTheSessionHoweverFastTheyCome) {
  for (const std::uint64_t apart_ms : {16, 40, 4}) {
    ScriptClock clock;
    EXPECT_LT(worst_error_s(clock, 1600, apart_ms * kNsPerMs), 0.001) << apart_ms;
  }
}

TEST(ScriptClock, StandsStillWithTheSessionAndIsNoSlowerAfterwards) {
  ScriptClock clock;
  worst_error_s(clock, 16, 16 * kNsPerMs);
  const Tick last = 16 + 119 * kTicksPerFrame;
  const std::uint64_t arrival = 5 * kNsPerMs + 119 * 16 * kNsPerMs;
  const double begin_s = clock.seconds(last, arrival, arrival + 15 * kNsPerMs);
  EXPECT_NEAR(clock.seconds(last, arrival, arrival + 10'000 * kNsPerMs), begin_s, 0.002);
  EXPECT_EQ(clock.seconds(last - 320, arrival + 10'000 * kNsPerMs, arrival + 10'000 * kNsPerMs),
            clock.seconds(last, arrival, arrival + 10'000 * kNsPerMs))
      << "a session that goes on where its recording ends";
  const Tick next = last + kTicksPerFrame;
  const double next_s =
      clock.seconds(next, arrival + 10'016 * kNsPerMs, arrival + 10'016 * kNsPerMs);
  EXPECT_NEAR(clock.seconds(next, arrival + 10'016 * kNsPerMs, arrival + 10'024 * kNsPerMs),
              next_s + 0.008, 0.001);
}

}  // namespace
}  // namespace trocar::app
