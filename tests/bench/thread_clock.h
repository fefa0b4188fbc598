#pragma once

// Clocks of the benchmarks: CPU time of the calling thread, of all threads of the process, and the
// wall. Wall time is reported beside CPU time where several threads work, never instead of it: on a
// shared machine it measures the neighbours.

#include <time.h>

#include <span>

namespace trocar::bench {

inline double seconds_on(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// One piece of work took so long, s.
struct Duration {
  double thread_cpu = 0, process_cpu = 0, wall = 0;
};

template <typename F>
Duration timed(F&& work) {
  const double wall = seconds_on(CLOCK_MONOTONIC);
  const double process = seconds_on(CLOCK_PROCESS_CPUTIME_ID);
  const double thread = seconds_on(CLOCK_THREAD_CPUTIME_ID);
  work();
  return {seconds_on(CLOCK_THREAD_CPUTIME_ID) - thread,
          seconds_on(CLOCK_PROCESS_CPUTIME_ID) - process, seconds_on(CLOCK_MONOTONIC) - wall};
}

// The value below which `share` of the values lie; 0 for none.
double percentile(std::span<const double> values, double share);
inline double median(std::span<const double> values) {
  return percentile(values, 0.5);
}

}  // namespace trocar::bench
