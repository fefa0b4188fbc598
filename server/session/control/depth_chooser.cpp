#include "server/session/control/depth_chooser.h"

#include <algorithm>

namespace trocar::control {

std::uint32_t DepthChooser::approach(std::uint32_t now, std::uint32_t wanted, std::uint32_t step) {
  if (wanted >= now) {
    room_ticks_ = 0;
    return wanted;
  }
  if (++room_ticks_ < kHold) return now;
  room_ticks_ = kHold - kLowerEvery;
  return std::max(wanted, now - std::min(now, std::max(1u, step)));
}

step::TickDecisions DepthChooser::choose(const step::TickDecisions& decided,
                                         std::span<const double> forces_n) {
  if (table_.empty()) return decided;
  ahead_.assign(forces_n.begin(), forces_n.end());
  for (auto& force : ahead_) force *= kAhead;
  // Nothing touched: as when the last tool left, so that its next touch finds enough.
  auto chosen = decided;
  if (decided.boundary == world::Boundary::Frozen) {
    if (!forces_n.empty())
      nodes_ =
          approach(nodes_, organ::frozen_nodes_for(table_, ahead_).value_or(decided.node_limit),
                   nodes_ / kNodeShare);
    chosen.node_limit =
        std::min(decided.node_limit, std::max(nodes_, std::min(least_nodes_, decided.node_limit)));
  } else {
    if (!forces_n.empty())
      depth_ = approach(depth_,
                        organ::graded_depth_for(table_, ahead_).value_or(decided.depth_limit), 1);
    chosen.depth_limit = std::min(decided.depth_limit, depth_);
  }
  return chosen;
}

void read_forces(const step::Simulation& simulation, std::vector<double>& forces_n) {
  forces_n.clear();
  const auto& contacts = simulation.context().contact.found;
  for (const auto& tool : contacts.tools)
    if (tool.begin != tool.end)
      forces_n.push_back(static_cast<double>(
          length(contact::reaction_on(contacts, tool, simulation.state().world).force_n)));
}

}  // namespace trocar::control
