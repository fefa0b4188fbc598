#include "server/lab/calibration/converged.h"

#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstdio>

namespace trocar::calibration {

step::TickDecisions Pilot::decisions(Tick tick) {
  step::TickDecisions decisions;
  if (tick % kPilotTicks == 0) {
    decisions.boundary = world::Boundary::Whole;
    decisions.sweeps = step::kMaxSweeps;
  }
  return decisions;
}

void Pilot::note(const step::TickReport& report, double force_n) {
  largest_force_n_ = std::max(largest_force_n_, force_n);
  if (report.tick % kPilotTicks == 0)
    rounding_n_ = std::max(rounding_n_, static_cast<double>(report.solve.figures.residual_n));
}

float Pilot::tolerance_for(double force_n, std::size_t nodes, double looser) const {
  const double per_node =
      kResidualShare * force_n / std::sqrt(std::max(1.0, static_cast<double>(nodes)));
  return static_cast<float>(looser * std::max(per_node, kAboveRounding * rounding_n_));
}

step::TickDecisions converged_decisions(float tolerance_n) {
  step::TickDecisions decisions{.boundary = world::Boundary::Whole};
  decisions.policy.residual_tolerance_n = tolerance_n;
  decisions.policy.max_sweeps = kMostConvergedSweeps;
  return decisions;
}

void Convergence::note(const step::TickReport& report, const step::TickDecisions& decisions) {
  const float tolerance = decisions.policy.residual_tolerance_n;
  if (tolerance == 0) return;
  add({tolerance, tolerance, 1, report.solve.is_converged ? 1u : 0u,
       report.solve.figures.residual_n, report.solve.figures.sweeps});
}

void Convergence::add(const Convergence& other) {
  if (other.ticks == 0) return;
  least_tolerance_n =
      ticks == 0 ? other.least_tolerance_n : std::min(least_tolerance_n, other.least_tolerance_n);
  tolerance_n = std::max(tolerance_n, other.tolerance_n);
  ticks += other.ticks;
  reached += other.reached;
  largest_residual_n = std::max(largest_residual_n, other.largest_residual_n);
  most_sweeps = std::max(most_sweeps, other.most_sweeps);
}

std::string Convergence::words() const {
  char text[200];
  int length = std::snprintf(text, sizeof text, "tolerance ");
  const auto rest = [&] { return text + length; };
  const auto room = [&] { return sizeof text - static_cast<std::size_t>(length); };
  if (least_tolerance_n < tolerance_n)
    length += std::snprintf(rest(), room(), "%.2g to ", static_cast<double>(least_tolerance_n));
  std::snprintf(rest(), room(),
                "%.2g N per node, reached in %" PRIu64 " of %" PRIu64
                " ticks, largest residual %.2g N, at most %" PRIu32 " sweeps",
                static_cast<double>(tolerance_n), reached, ticks,
                static_cast<double>(largest_residual_n), most_sweeps);
  return text;
}

}  // namespace trocar::calibration
