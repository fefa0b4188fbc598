#pragma once

// The solver sweeps these nodes most: the queue, then nodes that have left it a short while ago.
// Pressed nodes are swept as touched ones, but no force spreads from them in layers.
//
// Boundary::Frozen (the papers'): all other nodes stand still. A node that left the queue goes on
// being swept and stops only when, for 100 ticks in a row, its residual force, speed and
// displacement all stayed below thresholds: nothing freezes with a dent.
// Boundary::Graded: all other nodes move too, with fewer sweeps; a node that left the queue keeps
// all sweeps for 100 ticks, so that a change of class disturbs nothing; fewer where time is short.
// Boundary::Whole: every node that is not fixed is in the set, in ascending order, and stays.
// O(nodes in the set) per tick.

#include <span>
#include <vector>

#include "common/base/stamps.h"
#include "server/tissue/propagation/queue.h"
#include "server/tissue/world/world.h"

namespace trocar::propagation {

inline constexpr std::uint16_t kQuietTicks = 100;
inline constexpr float kQuietResidualNewton = 1e-4f;
inline constexpr float kQuietSpeedMetresPerSecond = 1e-3f;
// A tenth of the wire's quantum: nobody sees the rest of the way.
inline constexpr float kQuietDisplacementMetres = 3.2e-6f;

class ActiveSet {
 public:
  explicit ActiveSet(std::size_t node_count) {
    nodes_.reserve(node_count);
    before_.reserve(node_count);
    settled_.reserve(node_count);
    is_pressed_.resize(node_count);
  }

  // Classes were changed by somebody else.
  void forget() { has_history_ = false; }

  // Sets classes of queued and of pressed nodes to Active, of all nodes for Boundary::Whole. Sweep
  // order: pressed nodes ascending, the others in queue order, then lingering nodes ascending;
  // fixed nodes are left out. pressed: distinct.
  void collect(const PropagationQueue& queue, std::span<const NodeIndex> pressed,
               world::Boundary boundary, world::World& world);
  std::span<const NodeIndex> nodes() const { return nodes_; }
  // Returns how many of nodes() tissue presses: the first.
  std::size_t pressed_count() const { return pressed_count_; }

  // After the solve: counts ticks of lingering nodes (`residuals_n`: per entry of nodes()) and
  // lets go of those that are due: Graded: after linger_ticks. Returns the nodes whose displacement
  // it set to zero.
  std::span<const NodeIndex> settle(const PropagationQueue& queue,
                                    std::span<const float> residuals_n, std::uint32_t linger_ticks,
                                    world::World& world);

 private:
  void collect_whole(world::World& world);

  std::vector<NodeIndex> nodes_, before_, settled_;
  std::size_t pressed_count_ = 0;
  Stamps is_pressed_;  // per node
  bool has_history_ = false;
};

}  // namespace trocar::propagation
