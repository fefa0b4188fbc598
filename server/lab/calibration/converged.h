#pragma once

// A reference is a session whose every tick is solved until the forces balance: all nodes are swept
// until the residual is at most a tolerance. The tolerance follows from the force that is measured,
// and from what rounding leaves; a run before the reference, its pilot, finds both. Whoever uses a
// reference says whether each tick reached the tolerance, and what a looser one changes.

#include <cstdint>
#include <string>

#include "server/tissue/step/tick_report.h"

namespace trocar::calibration {

// The residuals of all nodes together, as one norm, are at most this share of the force.
inline constexpr double kResidualShare = 3e-5;
// No sweep brings the residual below what the rounding of floats leaves: the tolerance is at least
// so many times that. Nearly incompressible tissue of 4,000 nodes leaves 2e-6 N per node.
inline constexpr double kAboveRounding = 2;
// A reference's own error is its difference from one whose tolerance is so many times larger.
inline constexpr double kLooser = 10;
// A tick that has not reached its tolerance by then never will.
inline constexpr std::uint32_t kMostConvergedSweeps = 500;

// The pilot runs as a session does, but in every kPilotTicks-th tick all nodes are swept as often
// as may be: what is left then is rounding.
class Pilot {
 public:
  static constexpr Tick kPilotTicks = 16;

  static step::TickDecisions decisions(Tick tick);
  // force_n: the length of a force that the reference will be compared by.
  void note(const step::TickReport& report, double force_n);

  double largest_force_n() const { return largest_force_n_; }
  // The root mean square per node, as step::TickPolicy takes it, for this force.
  float tolerance_for(double force_n, std::size_t nodes, double looser = 1) const;
  // The same suits the largest force of the pilot itself.
  float tolerance_n(std::size_t nodes, double looser = 1) const {
    return tolerance_for(largest_force_n_, nodes, looser);
  }

 private:
  double largest_force_n_ = 0, rounding_n_ = 0;
};

step::TickDecisions converged_decisions(float tolerance_n);

// Convergence says what came of it in the ticks of a reference.
struct Convergence {
  float least_tolerance_n = 0, tolerance_n = 0;  // the tightest and the loosest of all ticks
  std::uint64_t ticks = 0, reached = 0;
  float largest_residual_n = 0;
  std::uint32_t most_sweeps = 0;

  // A tick that was not solved to a tolerance is not counted.
  void note(const step::TickReport& report, const step::TickDecisions& decisions);
  void add(const Convergence& other);
  bool is_reached() const { return ticks > 0 && reached == ticks; }
  // "tolerance 3e-07 to 4e-06 N per node, reached in 400 of 400 ticks, ..."
  std::string words() const;
};

}  // namespace trocar::calibration
