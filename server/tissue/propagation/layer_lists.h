#pragma once

// The labelled nodes of a search, ordered by layer, then contact, then node, and kept so: an update
// orders only the nodes whose label changed and copies the runs between them. O(changed nodes x
// log of a list) + a copy of the whole (a few bytes per node) + O(layers x contacts) + O(node_count
// / 4096).

#include <cstdint>
#include <span>
#include <vector>

#include "common/base/index.h"

namespace trocar::propagation {

// layer << 16 | contact.
using Label = std::uint32_t;
inline constexpr Label kNoLabel = 0xffffffffu;
inline constexpr Label kOneLayer = 1u << 16;
inline constexpr std::uint32_t layer_of(Label label) {
  return label >> 16;
}
inline constexpr std::uint16_t contact_of(Label label) {
  return static_cast<std::uint16_t>(label);
}

class LayeredSearch;

class LayerLists {
 public:
  void resize(std::size_t node_count);
  // Empty, without layers. Contacts may be fewer later, but not more.
  void clear(std::size_t contact_capacity);
  std::size_t contact_capacity() const { return contact_capacity_; }

  void update(const LayeredSearch& search);

  std::span<const NodeIndex> nodes() const { return nodes_; }
  std::size_t layer_count() const { return (begins_.size() - 1) / contact_capacity_; }
  // The list is empty from layer_count() on.
  std::span<const NodeIndex> layer(std::size_t layer) const {
    if (layer >= layer_count()) return {};
    return range(layer * contact_capacity_, (layer + 1) * contact_capacity_);
  }
  // Nodes of one contact in a layer, ascending.
  std::span<const NodeIndex> share(std::size_t layer, std::size_t contact) const {
    const auto list = layer * contact_capacity_ + contact;
    return range(list, list + 1);
  }

 private:
  // The changed nodes that leave or enter a list, ascending.
  struct Moves {
    std::vector<std::uint32_t> begins;  // per list, then the end
    std::vector<NodeIndex> nodes;

    void count(std::size_t list) { ++begins[list + 2]; }
    void place(std::size_t list, NodeIndex node) { nodes[begins[list + 1]++] = node; }
    void start(std::size_t list_count);
    void sum_up();
    std::span<const NodeIndex> of(std::size_t list) const {
      return std::span(nodes).subspan(begins[list], begins[list + 1] - begins[list]);
    }
  };

  std::span<const NodeIndex> range(std::size_t begin, std::size_t end) const {
    return std::span(nodes_).subspan(begins_[begin], begins_[end] - begins_[begin]);
  }
  std::size_t list_of(Label label) const {
    return layer_of(label) * contact_capacity_ + propagation::contact_of(label);
  }
  void sort_moves(const LayeredSearch& search, std::size_t list_count);
  void append(std::span<const NodeIndex> nodes);
  void append_changed(std::span<const NodeIndex> list, std::span<const NodeIndex> leaving,
                      std::span<const NodeIndex> entering);

  std::size_t contact_capacity_ = 1;
  std::vector<NodeIndex> nodes_, new_nodes_;
  std::vector<std::uint32_t> begins_{0}, new_begins_;  // per (layer, contact), then the end
  Moves leaving_, entering_;
  // A set of nodes that is read out ascending: bit per node, and bit per word of these.
  std::vector<std::uint64_t> bits_, used_words_;
};

}  // namespace trocar::propagation
