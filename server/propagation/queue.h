#pragma once

// Layered force propagation (Choi 2002 sec. 2.2-2.4): which nodes a tick moves, in which layers.
//
// All contacted nodes of all contacts enter first (layer 0), then every contact's layer 1, then
// every contact's layer 2, ...: equal depth has equal priority. Each node enters once, over the
// organ's neighbour table, so any mesh works. The search ends at the depth limit or at the node
// limit, which may fall inside a layer (Nakao 2003 sec. 4.2). Where the regions of two contacts
// overlap they become one region, on which their forces act together.
//
// Canonical order, a function of the state and not of the search: by layer; within a layer the
// contacts take turns, each giving its nodes in ascending order, so a node limit inside a layer
// treats them alike. A node belongs to the lowest contact that reaches it in the fewest layers.
// Two regions merge exactly if some node lies within the depth limit of both (without a node
// limit). O(nodes reached x neighbours); no allocation after warm-up.

#include <cstdint>
#include <span>
#include <vector>

#include "common/base/index.h"
#include "common/mesh/csr.h"

namespace trocar::propagation {

using Neighbours = mesh::Csr<NodeIndex, NodeIndex>;

struct QueueLimits {
  std::uint32_t depth = 6;
  std::uint32_t nodes = 1200;
};

class PropagationQueue {
 public:
  explicit PropagationQueue(std::size_t node_count);

  // `seeds[c]` are the nodes that contact c touches; a node touched by several belongs to the
  // first.
  void fill(const Neighbours& neighbours, std::span<const std::span<const NodeIndex>> seeds,
            const QueueLimits& limits);

  // In queue order.
  std::span<const NodeIndex> nodes() const { return nodes_; }
  std::size_t layer_count() const { return layer_offsets_.size() - 1; }
  std::span<const NodeIndex> layer(std::size_t depth) const {
    return std::span(nodes_).subspan(layer_offsets_[depth],
                                     layer_offsets_[depth + 1] - layer_offsets_[depth]);
  }
  bool contains(NodeIndex node) const { return stamp_[node.value] == current_; }
  // Merged region of a node: 0 if not in the queue, else 1, 2, ... by lowest contact.
  std::uint16_t region(NodeIndex node) const {
    return contains(node) ? region_of_contact_[contact_[node.value]] : std::uint16_t{0};
  }
  // Merged region of a contact; 0 for a contact without nodes in the queue.
  std::uint16_t region_of_contact(std::size_t contact) const { return region_of_contact_[contact]; }
  std::uint16_t region_count() const { return region_count_; }

 private:
  void offer(NodeIndex node, std::uint16_t contact);
  void enter_layer(std::uint32_t node_limit);
  std::uint16_t root(std::uint16_t contact);
  void merge(std::uint16_t a, std::uint16_t b);

  std::vector<NodeIndex> nodes_;
  std::vector<std::uint32_t> layer_offsets_{0};
  std::vector<std::uint16_t> region_of_contact_;
  std::uint16_t region_count_ = 0;
  // Per node, valid where the stamp is current_: O(1) clearing.
  std::vector<std::uint32_t> stamp_;          // in the queue
  std::vector<std::uint32_t> offered_stamp_;  // in the queue or offered to the next layer
  std::vector<std::uint16_t> contact_;
  std::uint32_t current_ = 0;
  std::vector<std::uint16_t> parent_;   // union-find over contacts
  std::vector<NodeIndex> offered_;      // distinct nodes of the next layer
  std::vector<std::uint64_t> keys_;     // contact << 32 | node, sorted
  std::vector<std::uint32_t> cursors_;  // per contact: next of its keys
};

}  // namespace trocar::propagation
