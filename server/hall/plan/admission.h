#pragma once

// Decides whether another session fits on the machine. A session takes what it is expected to take,
// or the most that has been measured of it, whichever is more: it may be idle now and busy later.

#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace trocar::hall {

// Taken for a session of which nothing is declared and nothing was measured: a tick takes one
// processor in full at most, unless it has more workers.
inline constexpr double kUnknownCores = 1;
// Simulated time of a tick.
inline constexpr double kTick_s = 1e-3;

struct Load {
  std::string name;
  double cores = 0;            // expected or measured, the more of both
  bool is_overloaded = false;  // it falls behind real time
  double tick_p99_s = 0;       // for the refusal
};

// A session takes so many cores while it is measured: processor seconds per second, and at least
// the part of real time that its ticks take.
double measured_cores(double processor_s, double wall_s, double tick_median_s);
// `declared` in the configuration, or `measured` in sessions before, or kUnknownCores per worker.
double expected_cores(std::optional<double> declared, std::optional<double> measured,
                      unsigned workers);

// ErrorCode::Refused with the numbers and what to do, if a session that takes `needed` cores would
// slow the running ones, or one of them is too slow already.
Status admit(const std::vector<Load>& running, const std::string& offer, double needed,
             double cores);

}  // namespace trocar::hall
