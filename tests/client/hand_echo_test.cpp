#include "client/replica/hand_echo.h"

#include <gtest/gtest.h>

#include <cmath>

namespace trocar::replica {
namespace {

constexpr std::uint64_t kMs = 1'000'000;

// A hand that goes to and fro.
Vec3f hand_at(std::uint64_t ns) {
  const auto seconds = static_cast<float>(ns) * 1e-9f;
  return {0.02f * std::sin(2 * seconds), 0.01f * seconds, 0};
}

TEST(HandEcho, FindsTheDelayBetweenReadings) {
  HandEcho echo;
  constexpr std::uint64_t kDelay = 83 * kMs;
  int measured = 0;
  for (std::uint64_t now = 1000 * kMs; now < 5000 * kMs; now += kMs) {
    if (now % (8 * kMs) == 0) echo.note_sent(hand_at(now), now);
    if (now % (16 * kMs) != 5 * kMs || now < 1200 * kMs) continue;
    const auto delay = echo.observe_ms(hand_at(now - kDelay), now - 78 * kMs, now);
    if (!delay) continue;
    ++measured;
    EXPECT_NEAR(*delay, 83, 3);
  }
  EXPECT_GT(measured, 200);
}

TEST(HandEcho, TellsTheTimesApartAtWhichAHandWasInOnePlace) {
  const auto strokes_at = [](std::uint64_t ns) {
    return Vec3f{0.02f * std::sin(8 * static_cast<float>(ns) * 1e-9f), 0, 0};
  };
  HandEcho echo;
  for (std::uint64_t now = 1000 * kMs; now < 5000 * kMs; now += kMs) {
    if (now % (8 * kMs) == 0) echo.note_sent(strokes_at(now), now);
    // The network gets slower by half a second in the middle.
    if (now >= 2500 * kMs && now < 3000 * kMs) continue;
    const std::uint64_t delay = (now < 2500 * kMs ? 83 : 583) * kMs;
    if (now % (16 * kMs) != 5 * kMs || now < 1700 * kMs) continue;
    const auto measured = echo.observe_ms(strokes_at(now - delay), now - delay + 3 * kMs, now);
    if (!measured) continue;
    EXPECT_NEAR(*measured, static_cast<double>(delay / kMs), 12) << now / kMs;
  }
}

TEST(HandEcho, SaysNothingOfAHandThatRestsOrIsElsewhere) {
  HandEcho echo;
  for (std::uint64_t now = 0; now < 1000 * kMs; now += 8 * kMs) echo.note_sent({0.1f, 0, 0}, now);
  EXPECT_FALSE(echo.observe_ms({0.1f, 0, 0}, 984 * kMs, 1000 * kMs));
  EXPECT_FALSE(echo.observe_ms({0.2f, 0, 0}, 984 * kMs, 1000 * kMs));
}

}  // namespace
}  // namespace trocar::replica
