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
#include "common/mesh/csr.h"
#include "server/propagation/layer_lists.h"
#include "server/propagation/seed_set.h"

namespace trocar::propagation {

using Neighbours = mesh::Csr<NodeIndex, NodeIndex>;

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

  // First half of an update. False, with the labels in disorder, as soon as more than half of them
  // fall: to clear() and start anew is cheaper then.
  [[nodiscard]] bool retract(const Neighbours& neighbours, const SeedSet& seeds,
                             const LayerLists& before);
  // Second half. `before`: the labels of the last update (empty after clear()).
  void advance(const Neighbours& neighbours, const SeedSet& seeds, const QueueLimits& limits,
               const LayerLists& before);

  Label label(NodeIndex node) const { return labels_[node.value]; }
  // Before the update.
  Label previous_label(NodeIndex node) const {
    return is_marked_[node.value] != 0 ? previous_labels_[node.value] : labels_[node.value];
  }
  // Nodes whose label is another one than before, in no useful order.
  std::span<const NodeIndex> changed() const { return changed_; }
  std::uint32_t depth() const { return depth_; }
  std::uint32_t previous_depth() const { return previous_depth_; }
  // Neighbour lists read by the update.
  std::size_t nodes_visited() const { return visited_; }

 private:
  void begin_update(std::size_t layers_before);
  void mark(NodeIndex node);
  void lose(NodeIndex node);
  bool is_supported(const Neighbours& neighbours, NodeIndex node);
  void take_next_best(const Neighbours& neighbours, const SeedSet& seeds);
  void offer(NodeIndex node, Label label);
  void expand(const Neighbours& neighbours, NodeIndex node);
  void settle_waiting(std::uint32_t layer);
  void cut_beyond_depth(const LayerLists& before);

  std::vector<Label> labels_;
  std::vector<Label> previous_labels_;     // where is_marked_
  std::vector<std::uint8_t> is_marked_;    // the label was touched in this update
  std::vector<std::uint8_t> is_in_layer_;  // settled in this update
  std::vector<NodeIndex> next_waiting_;    // list of nodes that wait for the same layer
  std::vector<NodeIndex> changed_;         // marked nodes; in the end those that differ
  std::vector<NodeIndex> layer_, next_layer_;
  std::vector<NodeIndex> first_waiting_;   // per layer; invalid: none
  std::vector<std::uint32_t> left_layer_;  // per layer before: marked nodes
  std::uint32_t depth_ = 0, previous_depth_ = 0;
  // No node lies beyond depth_: the whole component is labelled.
  bool is_exhausted_ = true;
  std::size_t visited_ = 0;
};

}  // namespace trocar::propagation
