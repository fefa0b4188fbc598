#pragma once

// Clocks of the benchmarks: CPU time of the calling thread, of all threads of the process, and the
// wall. Wall time is reported beside CPU time where several threads work, never instead of it: on a
// shared machine it measures the neighbours.

#include <time.h>

#include <algorithm>
#include <vector>

namespace trocar::bench {

inline double seconds_on(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// What one piece of work took, s.
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
inline double percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}
inline double median(std::vector<double> values) {
  return percentile(std::move(values), 0.5);
}

}  // namespace trocar::bench
