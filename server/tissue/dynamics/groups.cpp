#include "server/tissue/dynamics/groups.h"

#include <algorithm>
#include <functional>

#include "common/base/assert.h"
#include "common/math/morton.h"

namespace trocar::dynamics {
namespace {

// Stretch of the Morton curve within which nodes are sorted by valence: 8 groups.
constexpr std::size_t kSortStretch = 8 * kLanes;
// A colour with at most so many nodes is one to leave.
constexpr std::uint32_t kFewNodes = 2 * kLanes;
// Vacant lanes that any colour may have, and as a part of its lanes.
constexpr std::uint32_t kVacantLanes = kLanes, kVacantPart = 4;

// Organs lie within 2 m of the origin: 21 bits an axis resolve 2 um.
std::uint64_t code_of(const Vec3d& p) {
  const auto cell = [](double v) {
    return static_cast<std::uint64_t>(std::clamp((v + 2.0) * 0.25, 0.0, 1.0) * 2097151.0);
  };
  return morton_code(cell(p.x), cell(p.y), cell(p.z));
}

}  // namespace

template <typename Visit>
void Groups::for_each_coupled(const topology::Topology& topology, NodeIndex node, Visit&& visit) {
  topology.ties().for_each_tied(node, visit);
  if (coupling_ == Coupling::Elements) {
    topology.for_each_neighbour(node, visit);
    return;
  }
  node_stamp_.resize(topology.node_count());
  const auto stamp = ++stamp_;
  node_stamp_[node.value] = stamp;
  topology.for_each_neighbour(node, [&](NodeIndex j) {
    if (node_stamp_[j.value] == stamp) return;
    node_stamp_[j.value] = stamp;
    visit(j);
    topology.for_each_neighbour(j, [&](NodeIndex k) {
      if (k != node) visit(k);
    });
  });
}

template <typename ColourOf>
Colour Groups::smallest_free_colour(const topology::Topology& topology, NodeIndex node,
                                    ColourOf&& colour_of) {
  is_taken_.assign(is_taken_.size(), 0);
  for_each_coupled(topology, node, [&](NodeIndex j) {
    const Colour colour = colour_of(j);
    if (colour == kNoColour) return;
    if (colour >= is_taken_.size()) is_taken_.resize(colour + 1);
    is_taken_[colour] = 1;
  });
  return static_cast<Colour>(std::ranges::find(is_taken_, 0) - is_taken_.begin());
}

std::vector<Colour> Groups::greedy_colours(const topology::Topology& topology) {
  std::vector<Colour> colours(topology.node_count(), kNoColour);
  for (std::uint32_t i = 0; i < colours.size(); ++i)
    if (topology.has_node(NodeIndex(i)))
      colours[i] = smallest_free_colour(topology, NodeIndex(i),
                                        [&](NodeIndex j) { return colours[j.value]; });
  return colours;
}

Groups::Groups(const topology::Topology& topology, Coupling coupling, std::span<const Colour> given)
    : coupling_(coupling) {
  const auto colours =
      given.empty() ? greedy_colours(topology) : std::vector<Colour>(given.begin(), given.end());
  TROCAR_ASSERT(colours.size() == topology.node_count());
  std::vector<std::uint64_t> codes;
  std::vector<std::size_t> valences;
  std::vector<std::vector<std::uint32_t>> of_colour;
  std::vector<NodeIndex> neighbours;
  for (std::uint32_t i = 0; i < colours.size(); ++i) {
    const NodeIndex node(i);
    codes.push_back(code_of(topology.rest()[i]));
    topology.neighbours_of(node, neighbours);
    valences.push_back(topology.tets_of(node).size() * 2 +
                       (topology.has_links() ? topology.links_of(node).size() : neighbours.size()));
    if (!topology.has_node(node)) continue;
    if (colours[i] >= of_colour.size()) of_colour.resize(colours[i] + 1);
    of_colour[colours[i]].push_back(i);
  }
  slot_of_node_.assign(topology.node_count(), kNoSlot);
  vacancies_.resize(of_colour.size());
  members_.resize(of_colour.size());
  for (Colour colour = 0; colour < of_colour.size(); ++colour) {
    auto& nodes = of_colour[colour];
    std::ranges::sort(nodes, {}, [&](std::uint32_t i) { return std::pair(codes[i], i); });
    for (std::size_t begin = 0; begin < nodes.size(); begin += kSortStretch) {
      const auto end = std::min(begin + kSortStretch, nodes.size());
      std::stable_sort(nodes.begin() + static_cast<std::ptrdiff_t>(begin),
                       nodes.begin() + static_cast<std::ptrdiff_t>(end),
                       [&](std::uint32_t a, std::uint32_t b) { return valences[a] > valences[b]; });
    }
    for (const auto i : nodes) {
      if (node_of_slot_.size() % kLanes == 0) {
        colour_of_group_.push_back(colour);
        code_of_group_.push_back(codes[i]);
        ++members_[colour].groups;
      }
      ++members_[colour].nodes;
      slot_of_node_[i] = static_cast<Slot>(node_of_slot_.size());
      node_of_slot_.push_back(NodeIndex(i));
    }
    if (node_of_slot_.size() % kLanes == 0) continue;
    while (node_of_slot_.size() % kLanes != 0) node_of_slot_.emplace_back();
    vacancies_[colour].push_back(
        {code_of_group_.back(), static_cast<Group>(colour_of_group_.size() - 1)});
  }
}

double Groups::fill() const {
  std::size_t nodes = 0, groups = 0;
  for (const auto& members : members_) nodes += members.nodes, groups += members.groups;
  return static_cast<double>(nodes) / static_cast<double>(groups * kLanes);
}

// Ascending by a bit for each, then by counting: sorting them took longer than many a stage.
void Groups::order_by_colour(std::vector<Group>& groups,
                             std::vector<std::uint32_t>& colour_begins) const {
  constexpr std::size_t kBits = 64;
  marked_.assign((group_count() + kBits - 1) / kBits, 0);
  begins_.assign(colour_count() + 1, 0);
  for (const Group g : groups) {
    marked_[g / kBits] |= std::uint64_t{1} << g % kBits;
    ++begins_[colour_of_group_[g] + 1u];
  }
  for (std::size_t colour = 0; colour < colour_count(); ++colour)
    begins_[colour + 1] += begins_[colour];
  colour_begins.assign(begins_.begin(), begins_.end());
  for (std::size_t word = 0; word < marked_.size(); ++word)
    for (auto bits = marked_[word]; bits != 0; bits &= bits - 1) {
      const auto g =
          static_cast<Group>(word * kBits + static_cast<unsigned>(__builtin_ctzll(bits)));
      groups[begins_[colour_of_group_[g]]++] = g;
    }
}

// --- Following a change ---

void Groups::update(const topology::Topology& topology, std::span<const NodeIndex> changed) {
  moved_.clear();
  vacated_.clear();
  slot_of_node_.resize(topology.node_count(), kNoSlot);
  for (const auto node : changed)
    if (!topology.has_node(node) && slot_of(node) != kNoSlot) vacate(node);
  for (const auto node : changed) {
    if (!topology.has_node(node)) continue;
    const Colour own = colour_of(node);
    const bool is_to_leave = own != kNoColour && members_[own].nodes <= kFewNodes;
    if (own != kNoColour && !is_to_leave && !has_conflict(topology, node)) continue;
    const Colour colour =
        smallest_free_colour(topology, node, [&](NodeIndex j) { return colour_of(j); });
    if (is_to_leave && colour >= own && !has_conflict(topology, node)) continue;
    if (own != kNoColour) vacate(node);
    place(node, colour, code_of(topology.rest()[node.value]));
    moved_.push_back(node);
  }
  part_emptiest_groups(topology);
  while (!members_.empty() && members_.back().nodes == 0) members_.pop_back();
  std::ranges::sort(moved_);
  moved_.erase(std::unique(moved_.begin(), moved_.end()), moved_.end());
}

bool Groups::has_conflict(const topology::Topology& topology, NodeIndex node) {
  const Colour own = colour_of(node);
  bool is_taken = false;
  for_each_coupled(topology, node, [&](NodeIndex j) { is_taken |= colour_of(j) == own; });
  return is_taken;
}

std::uint32_t Groups::nodes_in(Group group) const {
  std::uint32_t count = 0;
  for (const auto node : nodes_of(group)) count += node.is_valid();
  return count;
}

void Groups::remove_node(NodeIndex node) {
  const Slot slot = slot_of(node);
  node_of_slot_[slot] = {};
  slot_of_node_[node.value] = kNoSlot;
  vacated_.push_back(slot);
  --members_[colour_of_group_[slot / kLanes]].nodes;
}

void Groups::give_up(Group group) {
  --members_[colour_of_group_[group]].groups;
  colour_of_group_[group] = kNoColour;
  empty_groups_.insert(std::ranges::lower_bound(empty_groups_, group, std::greater{}), group);
}

void Groups::vacate(NodeIndex node) {
  const Group group = slot_of(node) / kLanes;
  auto& vacancies = vacancies_[colour_of_group_[group]];
  const Vacancy own{code_of_group_[group], group};
  if (nodes_in(group) == kLanes) vacancies.insert(std::ranges::lower_bound(vacancies, own), own);
  remove_node(node);
  if (nodes_in(group) > 0) return;
  vacancies.erase(std::ranges::lower_bound(vacancies, own));
  give_up(group);
}

// Empties the emptiest groups of colours that lost a node, until few lanes are vacant. Each removed
// node brings at most about one other to a new lane.
void Groups::part_emptiest_groups(const topology::Topology& topology) {
  for (std::size_t i = 0, count = vacated_.size(); i < count; ++i) {
    const Colour colour = colour_of_group_[vacated_[i] / kLanes];
    if (colour == kNoColour) continue;
    const auto is_loose = [&] {
      const auto lanes = members_[colour].groups * kLanes;
      return lanes - members_[colour].nodes > kVacantLanes + lanes / kVacantPart;
    };
    while (is_loose()) {
      auto& vacancies = vacancies_[colour];
      const auto emptiest = std::ranges::min_element(
          vacancies, {}, [&](const Vacancy& v) { return nodes_in(v.group); });
      const Group group = emptiest->group;
      vacancies.erase(emptiest);
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const auto node = nodes_of(group)[lane];
        if (!node.is_valid()) continue;
        remove_node(node);
        place(node, colour, code_of(topology.rest()[node.value]));
        moved_.push_back(node);
      }
      give_up(group);
    }
  }
}

Group Groups::group_with_room(Colour colour, std::uint64_t code) {
  if (colour >= vacancies_.size()) vacancies_.resize(colour + 1);
  if (colour >= members_.size()) members_.resize(colour + 1);
  auto& vacancies = vacancies_[colour];
  if (!vacancies.empty()) {
    auto nearest = std::ranges::lower_bound(vacancies, Vacancy{code, 0});
    if (nearest == vacancies.end() ||
        (nearest != vacancies.begin() && code - (nearest - 1)->code <= nearest->code - code))
      --nearest;
    return nearest->group;
  }
  Group group = 0;
  if (empty_groups_.empty()) {
    group = static_cast<Group>(group_count());
    node_of_slot_.resize(node_of_slot_.size() + kLanes);
    colour_of_group_.push_back(colour);
    code_of_group_.push_back(code);
  } else {
    group = empty_groups_.back();
    empty_groups_.pop_back();
    colour_of_group_[group] = colour;
    code_of_group_[group] = code;
  }
  ++members_[colour].groups;
  vacancies.push_back({code, group});
  return group;
}

void Groups::place(NodeIndex node, Colour colour, std::uint64_t code) {
  const Group group = group_with_room(colour, code);
  const auto first = node_of_slot_.begin() + static_cast<std::ptrdiff_t>(group * kLanes);
  const auto at = std::find(first, first + kLanes, NodeIndex());
  *at = node;
  slot_of_node_[node.value] = static_cast<Slot>(at - node_of_slot_.begin());
  ++members_[colour].nodes;
  if (nodes_in(group) < kLanes) return;
  auto& vacancies = vacancies_[colour];
  vacancies.erase(std::ranges::lower_bound(vacancies, Vacancy{code_of_group_[group], group}));
}

}  // namespace trocar::dynamics
