#pragma once

// Which nodes the solver sweeps in `frozen` mode: the queue, then nodes that were moved before and
// have not come to rest. A node leaves only when, for 100 ticks in a row, its residual force, speed
// and displacement all stayed below thresholds: nothing freezes with a dent.

#include <span>
#include <vector>

#include "server/propagation/queue.h"
#include "server/world/world.h"

namespace trocar::propagation {

inline constexpr std::uint16_t kQuietTicks = 100;
inline constexpr float kQuietResidualNewton = 1e-4f;
inline constexpr float kQuietSpeedMetresPerSecond = 1e-3f;
// A tenth of the wire's quantum: nobody sees the rest of the way.
inline constexpr float kQuietDisplacementMetres = 3.2e-6f;

class ActiveSet {
 public:
  explicit ActiveSet(std::size_t node_count) { nodes_.reserve(node_count); }

  // Sets classes of queued nodes to Active. Sweep order: queue order, then lingering nodes
  // ascending; fixed nodes are left out.
  void collect(const PropagationQueue& queue, world::World& world);
  std::span<const NodeIndex> nodes() const { return nodes_; }

  // After the solve: counts quiet ticks of lingering nodes (`residuals_n`: per entry of nodes())
  // and freezes those that are due, at rest.
  void freeze_quiet(const PropagationQueue& queue, std::span<const float> residuals_n,
                    world::World& world) const;

 private:
  std::vector<NodeIndex> nodes_;
};

}  // namespace trocar::propagation
