#include "server/tissue/propagation/layered_search.h"

#include <algorithm>

namespace trocar::propagation {

void LayeredSearch::resize(std::size_t node_count) {
  labels_.resize(node_count, kNoLabel);
  previous_labels_.resize(node_count, kNoLabel);
  flags_.resize(node_count);
  next_waiting_.resize(node_count);
  changed_.reserve(node_count);
  contested_.reserve(node_count);
  layer_.reserve(node_count);
  next_layer_.reserve(node_count);
}

void LayeredSearch::clear(std::span<const NodeIndex> labelled) {
  for (const auto node : labelled) labels_[node.value] = previous_labels_[node.value] = kNoLabel;
  // Labels that a broken-off retract() took away are among `labelled`, for it gives none.
  begin_update(0);
  starts_anew_ = true;
  visited_ = 0;
  depth_ = 0;
  is_exhausted_ = true;
}

void LayeredSearch::begin_update(std::size_t layers_before) {
  for (const auto node : changed_) {
    flags_[node.value] = 0;
    previous_labels_[node.value] = labels_[node.value];
  }
  for (const auto node : contested_) flags_[node.value] = 0;
  changed_.clear();
  contested_.clear();
  layer_.clear();
  next_layer_.clear();
  left_layer_.assign(layers_before, 0);
}

void LayeredSearch::mark(NodeIndex node) {
  if ((flags_[node.value] & kMarked) != 0) return;
  flags_[node.value] |= kMarked;
  changed_.push_back(node);
  if (const Label label = labels_[node.value]; label != kNoLabel) ++left_layer_[layer_of(label)];
}

void LayeredSearch::lose(NodeIndex node) {
  mark(node);
  labels_[node.value] = kNoLabel;
  next_layer_.push_back(node);
}

bool LayeredSearch::is_supported(const Neighbours& neighbours, NodeIndex node) {
  ++visited_;
  const Label wanted = labels_[node.value] - kOneLayer;
  for (const auto neighbour : neighbours[node])
    if (labels_[neighbour.value] == wanted) return true;
  return false;
}

bool LayeredSearch::retract(const Neighbours& neighbours, const SeedSet& seeds,
                            const LayerLists& before) {
  begin_update(before.layer_count());
  starts_anew_ = false;
  visited_ = 0;
  const std::size_t most = before.nodes().size() / 3;
  for (const auto& change : seeds.changes())
    if (change.after > change.before) lose(change.node);
  if (2 * next_layer_.size() > before.layer(0).size()) return false;
  while (!next_layer_.empty()) {
    std::swap(layer_, next_layer_);
    next_layer_.clear();
    for (const auto node : layer_) {
      ++visited_;
      const Label supported = previous_labels_[node.value] + kOneLayer;
      for (const auto neighbour : neighbours[node])
        if (labels_[neighbour.value] == supported && !is_supported(neighbours, neighbour))
          lose(neighbour);
    }
    if (visited_ > most) return false;
  }
  visit_next_best(neighbours, seeds);
  return true;
}

// Every node without a label gets the best one that its neighbours offer now. It may still fall as
// better ones spread, so the node waits for its layer.
void LayeredSearch::visit_next_best(const Neighbours& neighbours, const SeedSet& seeds) {
  for (const auto node : changed_) {
    Label best = kNoLabel;
    if (const auto contact = seeds.contact_of(node); contact != SeedSet::kNoContact) {
      best = contact;
    } else {
      ++visited_;
      for (const auto neighbour : neighbours[node]) best = std::min(best, labels_[neighbour.value]);
      if (best != kNoLabel) best += kOneLayer;
    }
    if (best == kNoLabel) continue;
    labels_[node.value] = best;
    if (first_waiting_.size() <= layer_of(best)) first_waiting_.resize(layer_of(best) + 1);
    next_waiting_[node.value] = first_waiting_[layer_of(best)];
    first_waiting_[layer_of(best)] = node;
  }
}

void LayeredSearch::offer(NodeIndex node, Label label) {
  auto& flags = flags_[node.value];
  const Label known = labels_[node.value];
  if (known != kNoLabel && contact_of(known ^ label) != 0 && (flags & kContested) == 0) {
    flags |= kContested;
    contested_.push_back(node);
  }
  if (known <= label) return;
  mark(node);
  labels_[node.value] = label;
  if ((flags & kSettled) != 0) return;
  flags |= kSettled;
  next_layer_.push_back(node);
}

void LayeredSearch::expand(const Neighbours& neighbours, NodeIndex node) {
  ++visited_;
  const Label label = labels_[node.value] + kOneLayer;
  // Most neighbours have a better label, of the same contact, already.
  const Label* const labels = labels_.data();
  for (const auto neighbour : neighbours[node])
    if (const Label known = labels[neighbour.value];
        known > label || contact_of(known ^ label) != 0)
      offer(neighbour, label);
}

void LayeredSearch::settle_waiting(std::uint32_t layer) {
  if (layer >= first_waiting_.size()) return;
  for (auto node = first_waiting_[layer]; node.is_valid(); node = next_waiting_[node.value]) {
    // One that a better label reached meanwhile has been settled with it.
    if ((flags_[node.value] & kSettled) != 0) continue;
    flags_[node.value] |= kSettled;
    next_layer_.push_back(node);
  }
}

void LayeredSearch::advance(const Neighbours& neighbours, const SeedSet& seeds,
                            const QueueLimits& limits, const LayerLists& before) {
  const std::uint32_t depth_limit = std::min(limits.depth, kMaxDepth);
  previous_depth_ = depth_;
  const bool was_exhausted = is_exhausted_;
  is_exhausted_ = false;
  next_layer_.clear();
  for (const auto node : seeds.nodes()) offer(node, seeds.contact_of(node));
  std::size_t sum = 0;
  for (depth_ = 0;; ++depth_) {
    settle_waiting(depth_);
    const bool is_known = depth_ < before.layer_count();
    const std::size_t size =
        (is_known ? before.layer(depth_).size() - left_layer_[depth_] : 0) + next_layer_.size();
    sum += size;
    if (size == 0) {
      is_exhausted_ = true;
      if (depth_ > 0) --depth_;
      break;
    }
    if (depth_ == depth_limit || sum >= limits.nodes) break;
    std::swap(layer_, next_layer_);
    next_layer_.clear();
    for (const auto node : layer_) expand(neighbours, node);
    // The last layer before was never expanded; from there on everything is new.
    if (is_known && depth_ == previous_depth_ && !was_exhausted)
      for (const auto node : before.layer(depth_))
        if ((flags_[node.value] & kMarked) == 0) expand(neighbours, node);
  }
  cut_beyond_depth(before);
}

void LayeredSearch::cut_beyond_depth(const LayerLists& before) {
  if (starts_anew_) return;
  for (std::size_t layer = depth_ + 1; layer < before.layer_count(); ++layer)
    for (const auto node : before.layer(layer)) mark(node);
  for (const auto node : changed_)
    if (layer_of(labels_[node.value]) > depth_) labels_[node.value] = kNoLabel;
  std::fill(first_waiting_.begin(), first_waiting_.end(), NodeIndex());
  std::erase_if(changed_, [this](NodeIndex node) {
    if (labels_[node.value] != previous_labels_[node.value]) return false;
    flags_[node.value] = 0;
    return true;
  });
}

}  // namespace trocar::propagation
