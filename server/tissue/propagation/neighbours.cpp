#include "server/tissue/propagation/neighbours.h"

#include <algorithm>

namespace trocar::propagation {

void Neighbours::update(const topology::Topology& topology, std::span<const NodeIndex> nodes) {
  for (const auto node : nodes) {
    topology.neighbours_of(node, row_);
    const auto elements = row_.size();
    topology.ties().for_each_held(node, [&](NodeIndex j) { row_.push_back(j); });
    if (row_.size() > elements) {
      std::ranges::sort(row_);
      row_.erase(std::unique(row_.begin(), row_.end()), row_.end());
    }
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
