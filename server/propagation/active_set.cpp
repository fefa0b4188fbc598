#include "server/propagation/active_set.h"

namespace trocar::propagation {

using world::NodeClass;

void ActiveSet::collect(const PropagationQueue& queue, world::World& world) {
  nodes_.clear();
  for (const auto node : queue.nodes()) {
    if (world.node_classes[node.value] == NodeClass::Fixed) continue;
    world.node_classes[node.value] = NodeClass::Active;
    world.quiet_ticks[node.value] = 0;
    nodes_.push_back(node);
  }
  for (std::uint32_t i = 0; i < world.node_count(); ++i)
    if (world.node_classes[i] == NodeClass::Active && !queue.contains(NodeIndex(i)))
      nodes_.push_back(NodeIndex(i));
}

void ActiveSet::freeze_quiet(const PropagationQueue& queue, std::span<const float> residuals_n,
                             world::World& world) const {
  const auto below = [](const Vec3f& v, float limit) { return length_squared(v) < limit * limit; };
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const auto n = nodes_[i].value;
    if (queue.contains(nodes_[i])) continue;
    const bool is_quiet = residuals_n[i] < kQuietResidualNewton &&
                          below(world.velocities[n], kQuietSpeedMetresPerSecond) &&
                          below(world.displacements[n], kQuietDisplacementMetres);
    world.quiet_ticks[n] = is_quiet ? static_cast<std::uint16_t>(world.quiet_ticks[n] + 1) : 0;
    if (world.quiet_ticks[n] < kQuietTicks) continue;
    world.node_classes[n] = NodeClass::Frozen;
    world.quiet_ticks[n] = 0;
    world.displacements[n] = {};
    world.velocities[n] = {};
  }
}

}  // namespace trocar::propagation
