#pragma once

// Layered force propagation (Choi 2002 sec. 2.2-2.4): which nodes a tick moves, in which layers.
//
// All contacted nodes of all contacts enter first (layer 0), then every contact's layer 1, then
// every contact's layer 2, ...: equal depth has equal priority. Each node enters once, over the
// organ's neighbour table, so any mesh works. The search ends at the depth limit or at the node
// limit, which may fall inside a layer (Nakao 2003 sec. 4.2). Where the regions of two contacts
// overlap they become one region, on which their forces act together.
//
// Canonical order, a function of the inputs and not of the search or of earlier fills: by layer;
// within a layer the contacts take turns, each giving its nodes in ascending order, so a node limit
// inside a layer treats them alike. A node belongs to the lowest contact that reaches it in the
// fewest layers. The node limit lowers the depth limit to the first layer with which all layers
// together reach it, and cuts that layer's order. Two regions merge if some node lies within this
// depth of both (also one that the cut left out), or over further regions so connected.
//
// A fill repairs the previous one: equal inputs cost a comparison of the seeds; otherwise the work
// goes with the nodes whose layer or contact changes (layered_search.h), plus a copy of the order.
// When most of a region changes, it starts anew, at O(nodes reached x neighbours). No allocation
// after warm-up. Give a contact the same place in `seeds` from call to call, empty while it touches
// nothing: a shift of places changes the contact of every node.

#include <cstdint>
#include <span>
#include <vector>

#include "common/base/index.h"
#include "server/tissue/propagation/layer_lists.h"
#include "server/tissue/propagation/layered_search.h"
#include "server/tissue/propagation/region_borders.h"
#include "server/tissue/propagation/seed_set.h"

namespace trocar::propagation {

inline constexpr std::uint32_t kNoLayer = 0xffffffffu;

class PropagationQueue {
 public:
  explicit PropagationQueue(std::size_t node_count);

  // `seeds[c]` are the nodes that contact c touches; a node touched by several belongs to the
  // first. `neighbours` is symmetric. A table other than in the last call is noticed, and may have
  // more nodes; after a change inside it, call forget() first.
  void fill(const Neighbours& neighbours, Seeds seeds, const QueueLimits& limits);
  // The topology changed: the next fill starts anew. New nodes are not in the queue until then.
  void forget() { has_history_ = false; }
  void forget(std::size_t node_count) {
    forget();
    if (node_count > node_capacity_) resize(node_count);
  }

  // In queue order.
  std::span<const NodeIndex> nodes() const { return nodes_; }
  std::size_t layer_count() const { return layer_offsets_.size() - 1; }
  std::span<const NodeIndex> layer(std::size_t depth) const {
    return std::span(nodes_).subspan(layer_offsets_[depth],
                                     layer_offsets_[depth + 1] - layer_offsets_[depth]);
  }
  bool contains(NodeIndex node) const {
    const Label label = search_.label(node);
    return label < whole_end_ ||
           (label != kNoLabel && node.value < share_ends_[propagation::contact_of(label)]);
  }
  // Returns kNoLayer if the node is not in the queue.
  std::uint32_t layer_of(NodeIndex node) const {
    return contains(node) ? propagation::layer_of(search_.label(node)) : kNoLayer;
  }
  // Merged region of a node: 0 if not in the queue, else 1, 2, ... by lowest contact.
  std::uint16_t region(NodeIndex node) const {
    return contains(node) ? region_of_contact_[propagation::contact_of(search_.label(node))]
                          : std::uint16_t{0};
  }
  // Merged region of a contact; 0 for a contact that touches nothing.
  std::uint16_t region_of_contact(std::size_t contact) const { return region_of_contact_[contact]; }
  std::uint16_t region_count() const { return region_count_; }

  // Work of the last fill: neighbour lists read. 0 if its inputs were those of the fill before.
  std::size_t nodes_visited() const { return visited_; }

 private:
  struct Turn {
    std::span<const NodeIndex> nodes;  // that have not had their turn
    std::uint16_t contact = 0;
  };

  bool is_repeated(const Neighbours& neighbours, Seeds seeds, const QueueLimits& limits);
  void resize(std::size_t node_count);
  void start_anew(std::size_t contact_count);
  void order(std::size_t contact_count, std::uint32_t node_limit);
  void fill_in_turns(std::size_t layer, std::size_t contact_count, std::size_t room);

  // Inputs of the last fill.
  bool has_history_ = false;
  const NodeIndex* table_ = nullptr;
  std::size_t table_rows_ = 0, table_items_ = 0;
  std::size_t node_capacity_ = 0;
  QueueLimits limits_;
  SeedSet seeds_;

  LayeredSearch search_;
  LayerLists lists_;
  RegionBorders borders_;
  std::size_t visited_ = 0;

  std::vector<NodeIndex> nodes_;
  std::vector<std::uint32_t> layer_offsets_{0};
  std::vector<std::uint16_t> region_of_contact_;
  std::uint16_t region_count_ = 0;
  // All nodes with a label below are in the queue; of the others, those below their contact's end.
  Label whole_end_ = 0;
  std::vector<std::uint32_t> share_ends_;
  std::vector<Turn> turns_;
};

}  // namespace trocar::propagation
