#include "server/propagation/queue.h"

#include <algorithm>
#include <numeric>

namespace trocar::propagation {

PropagationQueue::PropagationQueue(std::size_t node_count)
    : stamp_(node_count), offered_stamp_(node_count), contact_(node_count) {
  nodes_.reserve(node_count);
  offered_.reserve(node_count);
  keys_.reserve(node_count);
}

std::uint16_t PropagationQueue::root(std::uint16_t contact) {
  while (parent_[contact] != contact) contact = parent_[contact] = parent_[parent_[contact]];
  return contact;
}

void PropagationQueue::merge(std::uint16_t a, std::uint16_t b) {
  a = root(a);
  b = root(b);
  parent_[std::max(a, b)] = std::min(a, b);
}

void PropagationQueue::offer(NodeIndex node, std::uint16_t contact) {
  auto& owner = contact_[node.value];
  if (offered_stamp_[node.value] != current_) {
    offered_stamp_[node.value] = current_;
    owner = contact;
    offered_.push_back(node);
  } else if (owner != contact) {
    // Reached by two contacts: the node lies in both regions. One that has already entered keeps
    // its contact; one of the coming layer goes to the lowest.
    merge(owner, contact);
    if (!contains(node)) owner = std::min(owner, contact);
  }
}

void PropagationQueue::enter_layer(std::uint32_t node_limit) {
  keys_.clear();
  for (const auto node : offered_)
    keys_.push_back(std::uint64_t{contact_[node.value]} << 32 | node.value);
  std::sort(keys_.begin(), keys_.end());
  offered_.clear();
  std::fill(cursors_.begin(), cursors_.end(), 0u);
  // cursors_[c] .. cursors_[c + 1]: keys of contact c; the lower end moves as nodes enter.
  for (const auto key : keys_) ++cursors_[(key >> 32) + 1];
  std::partial_sum(cursors_.begin(), cursors_.end(), cursors_.begin());
  const auto contact_count = cursors_.size() - 1;
  for (std::size_t rank = 0, entered = 0; entered < keys_.size(); ++rank) {
    std::uint32_t begin = 0;
    for (std::size_t c = 0; c < contact_count; ++c) {
      const std::uint32_t end = cursors_[c + 1];
      if (begin + rank < end) {
        ++entered;
        if (nodes_.size() >= node_limit) break;
        const NodeIndex node(static_cast<std::uint32_t>(keys_[begin + rank] & 0xffffffffu));
        stamp_[node.value] = current_;
        nodes_.push_back(node);
      }
      begin = end;
    }
    if (nodes_.size() >= node_limit) break;
  }
  layer_offsets_.push_back(static_cast<std::uint32_t>(nodes_.size()));
}

void PropagationQueue::fill(const Neighbours& neighbours,
                            std::span<const std::span<const NodeIndex>> seeds,
                            const QueueLimits& limits) {
  if (++current_ == 0) {
    std::fill(stamp_.begin(), stamp_.end(), 0u);
    std::fill(offered_stamp_.begin(), offered_stamp_.end(), 0u);
    current_ = 1;
  }
  nodes_.clear();
  layer_offsets_.assign(1, 0);
  cursors_.resize(seeds.size() + 1);
  parent_.resize(seeds.size());
  std::iota(parent_.begin(), parent_.end(), std::uint16_t{0});

  for (std::size_t c = 0; c < seeds.size(); ++c)
    for (const auto node : seeds[c]) offer(node, static_cast<std::uint16_t>(c));
  enter_layer(limits.nodes);
  for (std::uint32_t depth = 0; depth < limits.depth && nodes_.size() < limits.nodes; ++depth) {
    for (std::uint32_t i = layer_offsets_[depth]; i < layer_offsets_[depth + 1]; ++i)
      for (const auto neighbour : neighbours[nodes_[i]])
        offer(neighbour, contact_[nodes_[i].value]);
    if (offered_.empty()) break;
    enter_layer(limits.nodes);
  }

  region_of_contact_.assign(seeds.size(), 0);
  region_count_ = 0;
  for (std::uint16_t c = 0; c < seeds.size(); ++c) {
    if (seeds[c].empty()) continue;
    const auto r = root(c);
    if (region_of_contact_[r] == 0) region_of_contact_[r] = ++region_count_;
    region_of_contact_[c] = region_of_contact_[r];
  }
}

}  // namespace trocar::propagation
