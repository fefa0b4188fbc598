#include "server/hall/plan/admission.h"

#include <fmt/format.h>

#include <algorithm>

namespace trocar::hall {
namespace {

constexpr double kRounding = 1e-9;

}  // namespace

double measured_cores(double processor_s, double wall_s, double tick_median_s) {
  const double taken = wall_s > 0 ? processor_s / wall_s : 0;
  return std::max({0.0, taken, tick_median_s / kTick_s});
}

double expected_cores(std::optional<double> declared, std::optional<double> measured,
                      unsigned workers) {
  if (declared) return *declared;
  return measured.value_or(kUnknownCores * workers);
}

Status admit(const std::vector<Load>& running, const std::string& offer, double needed,
             double cores) {
  double taken = 0;
  std::string each;
  for (const auto& load : running) {
    if (load.is_overloaded)
      return Error{ErrorCode::Refused,
                   fmt::format("{} falls behind real time already (1 tick in 100 takes {:.2f} ms "
                               "or more of 1 ms): end a session first",
                               load.name, load.tick_p99_s * 1e3)};
    taken += load.cores;
    each += fmt::format("{}{} {:.2f}", each.empty() ? "" : ", ", load.name, load.cores);
  }
  if (taken + needed <= cores + kRounding) return {};
  if (running.empty())
    return Error{ErrorCode::Refused,
                 fmt::format("{} needs {:.2f} cores and this hall has {:.2f}: start it on a larger "
                             "machine, or raise cores",
                             offer, needed, cores)};
  return Error{ErrorCode::Refused,
               fmt::format("{} needs {:.2f} cores, and {:.2f} of {:.2f} are taken ({}): end a "
                           "session first",
                           offer, needed, taken, cores, each)};
}

}  // namespace trocar::hall
