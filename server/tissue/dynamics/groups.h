#pragma once

// Nodes in colours and groups of eight. No energy couples two nodes of one colour, so the nodes of
// a colour are solved at once, by lanes and by workers, with the same result as one after another.
//
// Colours are greedy in ascending node order: over the nodes of elements and ties, or, for energies
// over a node's whole smoothing domain, over nodes at distance two. Within a colour, nodes lie
// along a Morton curve so that what is near in space is near in memory, and are sorted by valence
// within stretches of the curve so that the lanes of a group have like amounts of work. A slot is a
// place in that order: group * 8 + lane; slots without a node are padding.
//
// When the topology changes, update() follows it locally. A node that may keep its colour keeps its
// slot. Others get, in ascending node order, the smallest colour that no node it couples with has,
// and the vacant lane of that colour that is nearest along the curve; a colour without one takes an
// empty group, or a new one at the end. A colour's groups therefore are a list, in ascending order:
// order_by_colour(). A lane whose node is removed is vacant; a group without nodes belongs to no
// colour until one takes it. So that groups stay full and colours few when an organ shrinks again,
// a changed node leaves a colour of few nodes for a smaller one that is free, and a colour with
// vacant lanes beyond a quarter parts its emptiest group among the others. Work is in proportion to
// what meets at the changed nodes, not to the organ, and nothing is allocated while capacities
// suffice.
//
// What a sweep does to a node is a function of the colours: which nodes share a group matters only
// to speed. But far nodes take turns by groups (SolveSettings::far_interval, LinearFarField), and
// after a change colours and groups are a function of the history of changes: whoever stores a
// state then stores the slot of every node beside the topology.

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

#include "common/base/blocks.h"
#include "common/base/index.h"
#include "server/tissue/dynamics/lanes.h"
#include "server/tissue/topology/topology.h"

namespace trocar::dynamics {

using Slot = std::uint32_t;
using Group = std::uint32_t;
using Colour = std::uint32_t;
inline constexpr Slot kNoSlot = 0xffffffffu;
inline constexpr Colour kNoColour = 0xffffffffu;
// Groups from this number on are packs: lanes of other groups, copied (lane_packs.h).
inline constexpr Group kFirstPack = 0x80000000u;

enum class Coupling : std::uint8_t { Elements, NodalStrain };

// Some lanes of a group.
struct GroupLanes {
  Group group = 0;
  std::uint8_t lanes = 0;  // bits

  bool has(std::size_t lane) const { return lanes >> lane & 1; }
};

class Groups {
 public:
  // colours: per place of a node, valid for the coupling; empty: greedy.
  Groups(const topology::Topology& topology, Coupling coupling,
         std::span<const Colour> colours = {});

  // The last one has nodes; others need not.
  std::size_t colour_count() const { return members_.size(); }
  std::size_t group_count() const { return node_of_slot_.size() / kLanes; }
  std::size_t slot_count() const { return node_of_slot_.size(); }
  // kNoColour: no node is in it.
  Colour colour_of(Group group) const { return colour_of_group_[group]; }
  // kNoColour: there is no such node.
  Colour colour_of(NodeIndex node) const {
    const Slot slot = slot_of(node);
    return slot == kNoSlot ? kNoColour : colour_of_group_[slot / kLanes];
  }

  // kNoSlot: there is no such node.
  Slot slot_of(NodeIndex node) const { return slot_of_node_[node.value]; }
  // Invalid for padding.
  NodeIndex node_at(Slot slot) const { return node_of_slot_[slot]; }
  std::span<const NodeIndex> nodes_of(Group group) const {
    return std::span(node_of_slot_).subspan(group * kLanes, kLanes);
  }
  // Share of lanes that hold a node, in groups of a colour.
  double fill() const;

  // Sorts groups that have nodes, each there once, by colour, and within one in ascending order.
  // colour_begins gets colour_count() + 1 entries. O(groups of all), a 64th of each. One thread.
  void order_by_colour(std::vector<Group>& groups, std::vector<std::uint32_t>& colour_begins) const;

  // changed: nodes whose existence or elements have changed, ascending, distinct.
  void update(const topology::Topology& topology, std::span<const NodeIndex> changed);
  // These return what the last update did: nodes that have a new slot, ascending, and slots that
  // lost their node (some of which hold another now).
  std::span<const NodeIndex> moved() const { return moved_; }
  std::span<const Slot> vacated() const { return vacated_; }

 private:
  // A group with a vacant lane, at its place along the curve.
  struct Vacancy {
    std::uint64_t code;
    Group group;
    auto operator<=>(const Vacancy&) const = default;
  };

  struct Members {
    std::uint32_t nodes = 0, groups = 0;
  };

  template <typename Visit>
  void for_each_coupled(const topology::Topology& topology, NodeIndex node, Visit&& visit);
  template <typename ColourOf>
  Colour smallest_free_colour(const topology::Topology& topology, NodeIndex node,
                              ColourOf&& colour_of);
  std::vector<Colour> greedy_colours(const topology::Topology& topology);
  bool has_conflict(const topology::Topology& topology, NodeIndex node);
  void vacate(NodeIndex node);
  void place(NodeIndex node, Colour colour, std::uint64_t code);
  Group group_with_room(Colour colour, std::uint64_t code);
  void remove_node(NodeIndex node);
  void give_up(Group group);
  void part_emptiest_groups(const topology::Topology& topology);
  std::uint32_t nodes_in(Group group) const;

  const Coupling coupling_;
  std::vector<NodeIndex> node_of_slot_;
  std::vector<Slot> slot_of_node_;
  std::vector<Colour> colour_of_group_;
  std::vector<std::uint64_t> code_of_group_;     // of the node that was first in it
  std::vector<Members> members_;                 // per colour
  std::vector<std::vector<Vacancy>> vacancies_;  // per colour, ascending; may be longer
  std::vector<Group> empty_groups_;              // descending
  std::vector<NodeIndex> moved_;
  std::vector<Slot> vacated_;
  // Scratch of order_by_colour().
  mutable std::vector<std::uint64_t> marked_;  // a bit per group
  mutable std::vector<std::uint32_t> begins_;
  // Marks of searches.
  std::vector<std::uint8_t> is_taken_;  // per colour
  std::vector<std::uint32_t> node_stamp_;
  std::uint32_t stamp_ = 0;
};

inline SlotLanes slots_of(Group group) {
  SlotLanes slots;
  for (std::uint32_t lane = 0; lane < kLanes; ++lane) slots.v[lane] = group * kLanes + lane;
  return slots;
}

// This says what a pack's lanes are to be copies of.
struct PackedLanes {
  Group group = kFirstPack;
  const SlotLanes& slots;
  std::uint8_t changed = 0, held = 0;  // lanes: to be copied; that hold a slot

  bool holds(std::size_t lane) const { return held >> lane & 1; }
};

// T is made of Lanes and SlotLanes alone.
template <typename T>
void copy_lane(const T& from, std::size_t from_lane, T& to, std::size_t to_lane) {
  static_assert(std::is_trivially_copyable_v<T> && sizeof(T) % sizeof(Lanes) == 0);
  const auto* const source = reinterpret_cast<const std::uint8_t*>(&from) + from_lane * 4;
  auto* const target = reinterpret_cast<std::uint8_t*>(&to) + to_lane * 4;
  for (std::size_t at = 0; at < sizeof(T); at += sizeof(Lanes))
    std::memcpy(target + at, source + at, 4);
}

// Rows of an energy: one entry per lane and incidence (a spring, a tet at the node). A group has as
// many rows as its node with the most incidences. Lanes that have fewer hold what Row{} has, must
// contribute nothing, and are told their own slot by pad(lane, slot) so that they read no other's.
// A Row is made of Lanes and SlotLanes alone.
template <typename Row>
class GroupRows {
 public:
  GroupRows() { packed_.end_building(); }

  std::span<const Row> operator[](Group g) const {
    return g < kFirstPack ? rows_[g] : packed_[g - kFirstPack];
  }
  std::span<Row> operator[](Group g) { return g < kFirstPack ? rows_[g] : packed_[g - kFirstPack]; }
  std::size_t group_count() const { return rows_.count(); }

  // bound(node): at least as many as its incidences. Before the first reshape().
  template <typename Bound>
  void reserve(const Groups& groups, Bound&& bound) {
    std::size_t total = 0;
    for (Group g = 0; g < groups.group_count(); ++g) {
      std::size_t most = 0;
      for (const auto node : groups.nodes_of(g))
        if (node.is_valid()) most = std::max<std::size_t>(most, bound(node));
      total += most;
    }
    rows_.reserve(total);
    extend(groups);
  }
  void end_building() { rows_.end_building(); }
  void extend(const Groups& groups) {
    rows_.extend(groups.group_count());
    counts_.resize(groups.slot_count());
  }

  // These lanes shall have so many incidences, entries of other lanes are ignored: they become
  // padding, to be filled; the other lanes keep theirs.
  std::span<Row> reshape(GroupLanes lanes, const std::array<std::uint32_t, kLanes>& counts) {
    std::uint32_t most = 0;
    const auto first = static_cast<Slot>(lanes.group * kLanes);
    for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
      auto& count = counts_[first + lane];
      if (lanes.has(lane)) count = counts[lane];
      most = std::max(most, count);
    }
    const auto old = rows_[lanes.group].size();
    const auto rows = rows_.resize(lanes.group, most);
    for (std::size_t i = 0; i < rows.size(); ++i)
      for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
        if (i < old && lanes.has(lane)) clear(rows[i], lane);
        if (i >= old || lanes.has(lane)) rows[i].pad(lane, first + lane);
      }
    return rows;
  }
  // These lanes of a pack become copies of their slots, padding where they hold none.
  void pack(const PackedLanes& pack) {
    const std::size_t index = pack.group - kFirstPack;
    packed_.extend(index + 1);
    packed_counts_.resize(std::max(packed_counts_.size(), (index + 1) * kLanes));
    std::uint32_t most = 0;
    for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
      auto& count = packed_counts_[index * kLanes + lane];
      if (pack.changed >> lane & 1) count = pack.holds(lane) ? counts_[pack.slots.v[lane]] : 0;
      most = std::max(most, count);
    }
    const auto old = packed_[index].size();
    const auto rows = packed_.resize(index, most);
    for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
      const Slot slot = pack.slots.v[lane];
      const bool is_changed = pack.changed >> lane & 1;
      const auto from = rows_[slot / kLanes];
      const std::size_t count = is_changed ? packed_counts_[index * kLanes + lane] : old;
      for (std::size_t i = 0; is_changed && i < count; ++i)
        copy_lane(from[i], slot % kLanes, rows[i], lane);
      for (std::size_t i = count; i < rows.size(); ++i) {
        if (i < old) clear(rows[i], lane);
        rows[i].pad(lane, slot);
      }
    }
  }
  void tidy() { rows_.tidy(); }
  // Rows in groups, and what there is memory for.
  std::size_t live() const { return rows_.live(); }
  std::size_t capacity() const { return rows_.capacity(); }

 private:
  static void clear(Row& row, std::size_t lane) {
    static_assert(std::is_trivially_copyable_v<Row> && sizeof(Row) % sizeof(Lanes) == 0);
    auto* const bytes = reinterpret_cast<std::uint8_t*>(&row) + lane * sizeof(float);
    for (std::size_t at = 0; at < sizeof(Row); at += sizeof(Lanes))
      std::memset(bytes + at, 0, sizeof(float));
  }

  Blocks<Row> rows_, packed_;
  std::vector<std::uint32_t> counts_, packed_counts_;  // per slot
};

// Values of groups, made of Lanes alone.
template <typename T>
class GroupValues {
 public:
  const T& operator[](Group g) const {
    return g < kFirstPack ? values_[g] : packed_[g - kFirstPack];
  }
  T& operator[](Group g) { return g < kFirstPack ? values_[g] : packed_[g - kFirstPack]; }
  std::size_t size() const { return values_.size(); }  // without packs
  void resize(std::size_t group_count) { values_.resize(group_count); }
  void pack(const PackedLanes& pack) {
    const std::size_t index = pack.group - kFirstPack;
    packed_.resize(std::max(packed_.size(), index + 1));
    for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
      const Slot slot = pack.slots.v[lane];
      if (pack.changed >> lane & 1)
        copy_lane(values_[slot / kLanes], slot % kLanes, packed_[index], lane);
    }
  }

 private:
  std::vector<T> values_, packed_;
};

}  // namespace trocar::dynamics
