#pragma once

// Simulated time. One tick is 1 ms; every 16th tick publishes a frame. Leases, scripts and timeouts
// inside the simulation count ticks and never read a clock.

#include <cstdint>

namespace trocar {

using Tick = std::uint64_t;   // ticks since the session began
using Frame = std::uint32_t;  // published frames since the session began; frame f shows tick 16 f

inline constexpr float kTickSeconds = 1e-3f;
inline constexpr Tick kTicksPerSecond = 1000;
inline constexpr Tick kTicksPerFrame = 16;  // 62.5 Hz
inline constexpr std::uint64_t kTickNanoseconds = 1'000'000;

inline bool publishes_frame(Tick tick) {
  return tick % kTicksPerFrame == 0;
}
inline Frame frame_of(Tick tick) {
  return static_cast<Frame>(tick / kTicksPerFrame);
}

}  // namespace trocar
