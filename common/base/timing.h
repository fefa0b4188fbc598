#pragma once

// Clocks for reports and pacing. State code never includes this: a tick reads no clock, the timers
// around its stages belong to StepReport and decide nothing.

#include <ctime>

#include <cstdint>

namespace trocar {

inline std::uint64_t clock_nanoseconds(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<std::uint64_t>(now.tv_sec) * 1'000'000'000u +
         static_cast<std::uint64_t>(now.tv_nsec);
}
inline std::uint64_t thread_cpu_ns() {
  return clock_nanoseconds(CLOCK_THREAD_CPUTIME_ID);
}
inline std::uint64_t monotonic_ns() {
  return clock_nanoseconds(CLOCK_MONOTONIC);
}
inline std::uint64_t utc_ns() {
  return clock_nanoseconds(CLOCK_REALTIME);
}

}  // namespace trocar
