#pragma once

// A sweep plan holds the groups, or packs, and lanes that a sweep goes over, colour by colour.

#include <span>
#include <vector>

#include "server/tissue/dynamics/groups.h"

namespace trocar::dynamics {

struct SweepPlan {
  std::vector<std::uint8_t> lanes;           // per group of the tissue
  std::vector<Group> groups;                 // with a lane; ascending by colour after finish()
  std::vector<std::uint32_t> colour_begins;  // into groups, colour_count + 1
  std::uint64_t node_count = 0;

  // Room for all groups.
  void reserve(const Groups& all) {
    lanes.resize(all.group_count());
    groups.reserve(all.group_count());
    colour_begins.resize(all.colour_count() + 1);
  }
  void clear() {
    for (const auto g : groups) lanes[g] = 0;
    groups.clear();
    node_count = 0;
  }
  void add(Group group, std::uint8_t bits) {
    if (bits == 0) return;
    if (lanes[group] == 0) groups.push_back(group);
    node_count += static_cast<unsigned>(__builtin_popcount(bits & ~lanes[group]));
    lanes[group] = static_cast<std::uint8_t>(lanes[group] | bits);
  }
  void add(const Groups& all, NodeIndex node) {
    const Slot slot = all.slot_of(node);
    add(slot / kLanes, static_cast<std::uint8_t>(1u << slot % kLanes));
  }
  std::span<const Group> of_colour(std::size_t colour) const {
    if (colour + 1 >= colour_begins.size()) return {};
    return std::span(groups).subspan(colour_begins[colour],
                                     colour_begins[colour + 1] - colour_begins[colour]);
  }
  // Sorts groups, or packs (LanePacks), by colour.
  template <typename Coloured>
  void finish(const Coloured& all) {
    all.order_by_colour(groups, colour_begins);
  }
};

}  // namespace trocar::dynamics
