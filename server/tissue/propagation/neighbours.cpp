#include "server/tissue/propagation/neighbours.h"

namespace trocar::propagation {

void Neighbours::update_changed(const topology::Topology& topology) {
  for (const auto node : topology.changed()) {
    topology.neighbours_of(node, row_);
    set(node, row_);
  }
  rows_.tidy();
}

void Neighbours::set(NodeIndex node, std::span<const NodeIndex> neighbours) {
  row_count_ = std::max<std::size_t>(row_count_, node.value + 1);
  changed_.resize(row_count_);
  auto& place = changed_[node.value];
  if (place == 0) {
    rows_.extend(rows_.count() + 1);
    place = static_cast<std::uint32_t>(rows_.count());
  }
  std::ranges::copy(neighbours,
                    rows_.resize(place - 1, static_cast<std::uint32_t>(neighbours.size())).begin());
}

}  // namespace trocar::propagation
