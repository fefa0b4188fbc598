#pragma once

// How much of a calibrated organ the next tick moves, from the forces of the one just done (Choi
// 2002 sec. 3): Frozen: the node limit, Graded: the depth. Never more than what is decided without
// it, which is the rate controller's or fixed; never fewer nodes than its least. Between ticks;
// what comes out is the tick's decision and journalled. An organ without a table changes nothing,
// nor does a force that the table does not know.
//
// It begins with the least. More is given at once, since forces rise with the tissue still short of
// nodes; less when less has been enough for kHold ticks without a break, by a sixteenth of the
// nodes or by a layer at a time. One thread, no clock.

#include <vector>

#include "server/organs/organ/depth_table.h"
#include "server/tissue/step/simulation.h"

namespace trocar::control {

class DepthChooser {
 public:
  static constexpr int kHold = 200, kLowerEvery = 8;
  // Forces are looked up this much larger: what a rising force will be a few ticks on.
  static constexpr double kAhead = 1.1;
  static constexpr std::uint32_t kNodeShare = 16;

  DepthChooser(organ::DepthTable table, std::uint32_t least_nodes)
      : table_(std::move(table)), least_nodes_(least_nodes) {}

  bool is_in_use() const { return !table_.empty(); }
  // Returns the decisions for the next tick. `decided` are those without the table; `forces_n` are
  // those on tools that touched in the last tick.
  step::TickDecisions choose(const step::TickDecisions& decided, std::span<const double> forces_n);

 private:
  std::uint32_t approach(std::uint32_t now, std::uint32_t wanted, std::uint32_t step);

  const organ::DepthTable table_;
  const std::uint32_t least_nodes_;
  std::vector<double> ahead_;
  std::uint32_t nodes_ = 0, depth_ = 0;
  int room_ticks_ = 0;
};

// Reads the force on each tool that touched something in the last tick, N.
void read_forces(const step::Simulation& simulation, std::vector<double>& forces_n);

}  // namespace trocar::control
