#pragma once

// One press of a round tip into an organ, tick by tick as in a session, with the force that the
// tissue has on it. From rest, straight along the surface's normal, at a steady speed.

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "server/lab/calibration/places.h"
#include "server/tissue/step/simulation.h"

namespace trocar::calibration {

struct PressPlan {
  double radius_m = 0.01;
  double depth_m = 0.01;    // at the end
  double speed_m_s = 0.04;  // of the tip
  Tick hold_ticks = 0;      // at full depth
  double slant = 0;         // the tip moves this much sideways per depth
};

struct PressCourse {
  std::vector<Vec3d> forces_n;              // of the tissue on the tool, per tick
  std::vector<std::uint32_t> queue_nodes;   // per tick
  std::vector<std::uint32_t> queue_depths;  // layers around the touched nodes, per tick
};

// Every node swept so often a tick: what others are compared with. How many sweeps that takes
// depends on the organ, see find_reference().
inline constexpr std::uint32_t kFullSweeps = 30;
step::TickDecisions full_decisions(std::uint32_t sweeps = kFullSweeps);

class PressBench {
 public:
  explicit PressBench(const organ::Organ& organ, unsigned workers = 1);

  // Decisions of a tick, from the forces of the tick before.
  using Decide = std::function<step::TickDecisions(std::span<const double> forces_n)>;
  PressCourse press(const Place& place, const PressPlan& plan, const Decide& decide);
  PressCourse press(const Place& place, const PressPlan& plan,
                    const step::TickDecisions& decisions);

  std::size_t node_count() const { return simulation_.organ().mesh.node_count(); }
  std::uint64_t ticks_done() const { return ticks_; }

 private:
  step::Simulation simulation_;
  Bytes rest_;
  std::uint64_t ticks_ = 0;
};

// A number of sweeps with which a press is converged.
struct Reference {
  std::uint32_t sweeps = kFullSweeps;
  // The second half of the sweeps changes the force by this share of its largest value. Further
  // sweeps change it by less, since each half changes less.
  double own_error = 0;
  double tolerance = 0;

  bool is_converged() const { return own_error <= tolerance; }
  step::TickDecisions decisions() const { return full_decisions(sweeps); }
};
// The largest difference of two presses' forces over the second's largest; NaN without a force.
double force_difference(const PressCourse& a, const PressCourse& b);
// Doubles kFullSweeps, at the first place that can be pressed, while half of the sweeps differ by
// more than the tolerance and a tick may have as many.
Reference find_reference(PressBench& bench, std::span<const Place> places, const PressPlan& plan,
                         double tolerance);

}  // namespace trocar::calibration
