#pragma once

// Distances from all seeds, kept from fill to fill and repaired where the seeds changed.
//
// A node's label is (layer, contact): the fewest layers in which any contact reaches it, then the
// lowest contact that does so; as one integer, the smallest of its own seed's label and of its
// neighbours' labels one layer on. Repair after Ramalingam and Reps 1996, with layers in place of
// their heap: retract() takes away every label whose only support was a seed that left (layer by
// layer, so each is judged when all before it are known); advance() lets the smaller labels spread,
// again layer by layer. Labels that stay are not looked at, except next to ones that do not.
//
// Layers beyond depth() carry no label: it is the depth limit, or the layer in which the sum of all
// layers reaches the node limit, or the last one that has nodes. The last layer is always whole, so
// labels depend on nothing but the inputs. Needs a symmetric neighbour table. O(nodes whose label
// changes x neighbours), plus one layer when depth() changes.

#include <cstdint>
#include <span>
#include <vector>

#include "common/base/index.h"
#include "server/tissue/propagation/layer_lists.h"
#include "server/tissue/propagation/neighbours.h"
#include "server/tissue/propagation/seed_set.h"

namespace trocar::propagation {

struct QueueLimits {
  std::uint32_t depth = 6;
  std::uint32_t nodes = 1200;

  bool operator==(const QueueLimits&) const = default;
};

class LayeredSearch {
 public:
  // Deeper limits act as this one: a label has 16 bits for the layer.
  static constexpr std::uint32_t kMaxDepth = 0xfffd;

  void resize(std::size_t node_count);
  // Forgets all labels; `labelled` names the nodes that had one when the last update ended.
  void clear(std::span<const NodeIndex> labelled);

  // First half of an update. False, with the labels in disorder, as soon as it has read a third as
  // many neighbour lists as there are labels, or if most seeds left: to clear() and start anew is
  // cheaper then (measured: a repair that goes on to the end costs up to twice a new start).
  [[nodiscard]] bool retract(const Neighbours& neighbours, const SeedSet& seeds,
                             const LayerLists& before);
  // Second half. `before`: the labels of the last update (empty after clear()).
  void advance(const Neighbours& neighbours, const SeedSet& seeds, const QueueLimits& limits,
               const LayerLists& before);

  Label label(NodeIndex node) const { return labels_[node.value]; }
  // Before the update.
  Label previous_label(NodeIndex node) const { return previous_labels_[node.value]; }
  // Nodes whose label is another one than before, in no useful order.
  std::span<const NodeIndex> changed() const { return changed_; }
  // After clear(), every label is new; then these are the nodes that more than one contact reaches
  // within the depth. Each edge between nodes of two contacts, with an end that is not in the last
  // layer, has an end among them.
  bool starts_anew() const { return starts_anew_; }
  std::span<const NodeIndex> contested() const { return contested_; }
  bool is_contested(NodeIndex node) const { return (flags_[node.value] & kContested) != 0; }

  std::uint32_t depth() const { return depth_; }
  std::uint32_t previous_depth() const { return previous_depth_; }
  // Neighbour lists read by the update.
  std::size_t nodes_visited() const { return visited_; }

 private:
  static constexpr std::uint8_t kMarked = 1, kSettled = 2, kContested = 4;

  void begin_update(std::size_t layers_before);
  void mark(NodeIndex node);
  void lose(NodeIndex node);
  bool is_supported(const Neighbours& neighbours, NodeIndex node);
  void visit_next_best(const Neighbours& neighbours, const SeedSet& seeds);
  void offer(NodeIndex node, Label label);
  void expand(const Neighbours& neighbours, NodeIndex node);
  void settle_waiting(std::uint32_t layer);
  void cut_beyond_depth(const LayerLists& before);

  std::vector<Label> labels_;
  std::vector<Label> previous_labels_;   // outside an update: labels_ before the last one
  std::vector<std::uint8_t> flags_;      // kMarked...: what this update did to the node
  std::vector<NodeIndex> next_waiting_;  // list of nodes that wait for the same layer
  std::vector<NodeIndex> changed_;       // marked nodes; in the end those that differ
  std::vector<NodeIndex> contested_;
  std::vector<NodeIndex> layer_, next_layer_;
  std::vector<NodeIndex> first_waiting_;   // per layer; invalid: none
  std::vector<std::uint32_t> left_layer_;  // per layer before: marked nodes
  std::uint32_t depth_ = 0, previous_depth_ = 0;
  // No node lies beyond depth_: the whole component is labelled.
  bool is_exhausted_ = true;
  bool starts_anew_ = true;
  std::size_t visited_ = 0;
};

}  // namespace trocar::propagation
