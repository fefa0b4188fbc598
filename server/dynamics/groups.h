#pragma once

// Nodes in colours and groups of eight. No energy couples two nodes of one colour, so the nodes of
// a colour are solved at once, by lanes and by workers, with the same result as one after another.
//
// Colours are greedy in ascending node order: over elements' nodes, or, for energies over a node's
// whole star, over nodes at distance two. Within a colour, nodes lie along a Morton curve so that
// what is near in space is near in memory, and are sorted by valence within stretches of the curve
// so that the lanes of a group have like amounts of work. A slot is a place in that order: group *
// 8 + lane; slots without a node pad the end of each colour. Constant after construction.
//
// Results are a function of the colours: which nodes share a group matters only to speed.

#include <cstdint>
#include <span>
#include <vector>

#include "common/base/index.h"
#include "common/scene/organ.h"
#include "server/dynamics/lanes.h"

namespace trocar::dynamics {

using Slot = std::uint32_t;
using Group = std::uint32_t;
inline constexpr Slot kNoSlot = 0xffffffffu;

enum class Coupling : std::uint8_t { Elements, Stars };

class Groups {
 public:
  Groups(const scene::Organ& organ, Coupling coupling);

  std::size_t colour_count() const { return colour_groups_.size() - 1; }
  std::size_t group_count() const { return node_of_slot_.size() / kLanes; }
  std::size_t slot_count() const { return node_of_slot_.size(); }
  // Groups of a colour: [first, last).
  Group first_group(std::size_t colour) const { return colour_groups_[colour]; }
  Group last_group(std::size_t colour) const { return colour_groups_[colour + 1]; }

  Slot slot_of(NodeIndex node) const { return slot_of_node_[node.value]; }
  // Invalid for padding.
  NodeIndex node_at(Slot slot) const { return node_of_slot_[slot]; }
  std::span<const NodeIndex> nodes_of(Group group) const {
    return std::span(node_of_slot_).subspan(group * kLanes, kLanes);
  }
  // Share of lanes that hold a node.
  double fill() const;

 private:
  std::vector<NodeIndex> node_of_slot_;
  std::vector<Slot> slot_of_node_;
  std::vector<Group> colour_groups_{0};
};

// Rows of an energy: one entry per lane and incidence (a spring, a tet at the node). A group has as
// many rows as its node with the most incidences. Lanes that have fewer hold what Row{} has, must
// contribute nothing, and are told their own slot by pad(lane, slot) so that they read no other's.
template <typename Row>
struct GroupRows {
  std::vector<std::uint32_t> offsets;  // group_count + 1
  std::vector<Row> rows;

  std::span<const Row> operator[](Group g) const {
    return {rows.data() + offsets[g], offsets[g + 1] - offsets[g]};
  }
  std::span<Row> operator[](Group g) {
    return {rows.data() + offsets[g], offsets[g + 1] - offsets[g]};
  }
};

// counts: incidences per node. fill(row, lane, node, i): writes incidence i of a node.
template <typename Row, typename Fill>
GroupRows<Row> make_rows(const Groups& groups, std::span<const std::uint32_t> counts, Fill&& fill) {
  GroupRows<Row> result;
  result.offsets.push_back(0);
  for (Group g = 0; g < groups.group_count(); ++g) {
    std::uint32_t most = 0;
    for (const auto node : groups.nodes_of(g))
      if (node.is_valid() && counts[node.value] > most) most = counts[node.value];
    result.offsets.push_back(result.offsets.back() + most);
  }
  result.rows.resize(result.offsets.back());
  for (Group g = 0; g < groups.group_count(); ++g)
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const auto node = groups.nodes_of(g)[lane];
      const std::uint32_t count = node.is_valid() ? counts[node.value] : 0;
      const auto rows = result[g];
      for (std::uint32_t i = 0; i < count; ++i) fill(rows[i], lane, node, i);
      for (std::size_t i = count; i < rows.size(); ++i)
        rows[i].pad(lane, static_cast<Slot>(g * kLanes + lane));
    }
  return result;
}

}  // namespace trocar::dynamics
