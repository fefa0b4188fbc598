#pragma once

// One press of a round tip into an organ, tick by tick as in a session, with the force that the
// tissue has on it. From rest, straight along the surface's normal, at a steady speed.

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "server/lab/calibration/converged.h"
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
  Convergence convergence;                  // of ticks that were solved to a tolerance
};

class PressBench {
 public:
  explicit PressBench(const organ::Organ& organ, unsigned workers = 1);

  // Decisions of a tick, from the forces of the tick before.
  using Decide = std::function<step::TickDecisions(std::span<const double> forces_n)>;
  PressCourse press(const Place& place, const PressPlan& plan, const Decide& decide);
  PressCourse press(const Place& place, const PressPlan& plan,
                    const step::TickDecisions& decisions);
  // The report of each tick goes to `observe`, with the force of the tissue on the tool.
  using Observe = std::function<void(const step::TickReport&, const Vec3d& force_n)>;
  PressCourse run(const Place& place, const PressPlan& plan, const Decide& decide,
                  const Observe& observe);
  Pilot pilot(const Place& place, const PressPlan& plan);

  const step::Simulation& simulation() const { return simulation_; }
  std::size_t node_count() const { return simulation_.organ().mesh.node_count(); }
  std::uint64_t ticks_done() const { return ticks_; }

 private:
  step::Simulation simulation_;
  Bytes rest_;
  std::uint64_t ticks_ = 0;
};

}  // namespace trocar::calibration
