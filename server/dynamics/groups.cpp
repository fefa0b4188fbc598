#include "server/dynamics/groups.h"

#include <algorithm>
#include <numeric>

namespace trocar::dynamics {
namespace {

// Stretch of the Morton curve within which nodes are sorted by valence: 8 groups.
constexpr std::size_t kSortStretch = 8 * kLanes;

// Calls visit(j) for every node j != i that shares an element with i; some more than once.
template <typename Visit>
void for_each_neighbour(const mesh::TetMesh& mesh, NodeIndex i, Visit&& visit) {
  for (const auto link : mesh.node_links[i])
    for (const auto j : mesh.links[link.value])
      if (j != i) visit(j);
  for (const auto edge : mesh.node_edges[i])
    for (const auto j : mesh.edges[edge.value])
      if (j != i) visit(j);
}

std::vector<std::uint32_t> greedy_colours(const mesh::TetMesh& mesh, Coupling coupling) {
  const auto count = static_cast<std::uint32_t>(mesh.node_count());
  constexpr std::uint32_t kNone = 0xffffffffu;
  std::vector<std::uint32_t> colours(count, kNone), taken_by;
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto take = [&](NodeIndex j) {
      const auto colour = colours[j.value];
      if (colour == kNone) return;
      if (colour >= taken_by.size()) taken_by.resize(colour + 1, kNone);
      taken_by[colour] = i;
    };
    for_each_neighbour(mesh, NodeIndex(i), [&](NodeIndex j) {
      take(j);
      if (coupling == Coupling::Stars) for_each_neighbour(mesh, j, take);
    });
    std::uint32_t colour = 0;
    while (colour < taken_by.size() && taken_by[colour] == i) ++colour;
    colours[i] = colour;
  }
  return colours;
}

// Bits of x spread to every third place.
std::uint64_t spread(std::uint64_t x) {
  x = (x | x << 32) & 0x001f00000000ffffull;
  x = (x | x << 16) & 0x001f0000ff0000ffull;
  x = (x | x << 8) & 0x100f00f00f00f00full;
  x = (x | x << 4) & 0x10c30c30c30c30c3ull;
  return (x | x << 2) & 0x1249249249249249ull;
}

// Organs lie within 2 m of the origin: 21 bits an axis resolve 2 um.
std::uint64_t morton_code(const Vec3d& p) {
  const auto cell = [](double v) {
    return static_cast<std::uint64_t>(std::clamp((v + 2.0) * 0.25, 0.0, 1.0) * 2097151.0);
  };
  return spread(cell(p.x)) | spread(cell(p.y)) << 1 | spread(cell(p.z)) << 2;
}

}  // namespace

Groups::Groups(const scene::Organ& organ, Coupling coupling) {
  const auto& mesh = organ.mesh;
  const auto colours = greedy_colours(mesh, coupling);
  const auto colour_count =
      colours.empty() ? 0u : *std::max_element(colours.begin(), colours.end()) + 1;
  std::vector<std::uint64_t> codes;
  for (const auto& p : mesh.rest_positions) codes.push_back(morton_code(p));
  const auto valence = [&](std::uint32_t i) {
    return mesh.node_tets[NodeIndex(i)].size() * 2 + mesh.node_neighbours[NodeIndex(i)].size();
  };
  std::vector<std::vector<std::uint32_t>> of_colour(colour_count);
  for (std::uint32_t i = 0; i < colours.size(); ++i) of_colour[colours[i]].push_back(i);
  slot_of_node_.assign(mesh.node_count(), kNoSlot);
  for (auto& nodes : of_colour) {
    std::ranges::sort(nodes, {}, [&](std::uint32_t i) { return std::pair(codes[i], i); });
    for (std::size_t begin = 0; begin < nodes.size(); begin += kSortStretch) {
      const auto end = std::min(begin + kSortStretch, nodes.size());
      std::stable_sort(nodes.begin() + static_cast<std::ptrdiff_t>(begin),
                       nodes.begin() + static_cast<std::ptrdiff_t>(end),
                       [&](std::uint32_t a, std::uint32_t b) { return valence(a) > valence(b); });
    }
    for (const auto i : nodes) {
      slot_of_node_[i] = static_cast<Slot>(node_of_slot_.size());
      node_of_slot_.push_back(NodeIndex(i));
    }
    while (node_of_slot_.size() % kLanes != 0) node_of_slot_.emplace_back();
    colour_groups_.push_back(static_cast<Group>(node_of_slot_.size() / kLanes));
  }
}

double Groups::fill() const {
  return static_cast<double>(slot_of_node_.size()) / static_cast<double>(node_of_slot_.size());
}

}  // namespace trocar::dynamics
