#include "server/tissue/propagation/active_set.h"

#include <algorithm>

namespace trocar::propagation {

using world::Boundary;
using world::NodeClass;

void ActiveSet::collect(const PropagationQueue& queue, std::span<const NodeIndex> pressed,
                        Boundary boundary, world::World& world) {
  pressed_count_ = 0;
  if (boundary == Boundary::Whole) return collect_whole(world);
  std::swap(nodes_, before_);
  nodes_.clear();
  const bool stops_outer = boundary == Boundary::Frozen && world.boundary != boundary;
  if (!has_history_ || stops_outer) {
    // The state was restored, or nodes that moved are about to stop: whoever is not at rest
    // lingers.
    before_.clear();
    for (std::uint32_t i = 0; i < world.node_count(); ++i) {
      auto& node_class = world.node_classes[i];
      if (stops_outer && node_class == NodeClass::Far) {
        node_class = NodeClass::Active;
        world.quiet_ticks[i] = 0;
      }
      if (node_class == NodeClass::Active) before_.push_back(NodeIndex(i));
    }
    has_history_ = true;
  }
  world.boundary = boundary;
  is_pressed_.resize(world.node_count());
  is_pressed_.begin();
  const auto add = [&](NodeIndex node) {
    if (world.node_classes[node.value] == NodeClass::Fixed) return;
    world.node_classes[node.value] = NodeClass::Active;
    world.quiet_ticks[node.value] = 0;
    nodes_.push_back(node);
  };
  for (const auto node : pressed)
    if (is_pressed_.insert(node.value)) add(node);
  pressed_count_ = nodes_.size();
  for (const auto node : queue.nodes())
    if (!is_pressed_.has(node.value)) add(node);
  const auto queued = nodes_.size();
  for (const auto node : before_)
    if (world.node_classes[node.value] == NodeClass::Active && !queue.contains(node) &&
        !is_pressed_.has(node.value))
      nodes_.push_back(node);
  std::sort(nodes_.begin() + static_cast<std::ptrdiff_t>(queued), nodes_.end());
}

void ActiveSet::collect_whole(world::World& world) {
  world.boundary = Boundary::Whole;
  has_history_ = true;
  nodes_.clear();
  for (std::uint32_t i = 0; i < world.node_count(); ++i) {
    if (world.node_classes[i] == NodeClass::Fixed) continue;
    world.node_classes[i] = NodeClass::Active;
    world.quiet_ticks[i] = 0;
    nodes_.push_back(NodeIndex(i));
  }
}

std::span<const NodeIndex> ActiveSet::settle(const PropagationQueue& queue,
                                             std::span<const float> residuals_n,
                                             std::uint32_t linger_ticks, world::World& world) {
  const auto below = [](const Vec3f& v, float limit) { return length_squared(v) < limit * limit; };
  settled_.clear();
  if (world.boundary == Boundary::Whole) return settled_;
  const auto enough = world.boundary == Boundary::Graded ? linger_ticks : kQuietTicks;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const auto n = nodes_[i].value;
    if (i < pressed_count_ || queue.contains(nodes_[i])) continue;
    const bool is_quiet = world.boundary == Boundary::Graded ||
                          (residuals_n[i] < kQuietResidualNewton &&
                           below(world.velocities[n], kQuietSpeedMetresPerSecond) &&
                           below(world.displacements[n], kQuietDisplacementMetres));
    world.quiet_ticks[n] = is_quiet ? static_cast<std::uint16_t>(world.quiet_ticks[n] + 1) : 0;
    if (world.quiet_ticks[n] < enough) continue;
    world.node_classes[n] = NodeClass::Far;
    world.quiet_ticks[n] = 0;
    if (world.boundary == Boundary::Graded) continue;
    world.displacements[n] = {};
    world.velocities[n] = {};
    settled_.push_back(nodes_[i]);
  }
  return settled_;
}

}  // namespace trocar::propagation
