#include "tests/dynamics/edited_organ.h"

#include <algorithm>

#include "server/tissue/topology/tet_shape.h"

namespace trocar::dynamics::testing {

NodeIndex EditedOrgan::any_node() {
  for (;;) {
    const NodeIndex node(below(topology_.node_count()));
    if (topology_.has_node(node)) return node;
  }
}

// The first unused one, or the next at the end.
NodeIndex EditedOrgan::free_node_place() const {
  NodeIndex place(0);
  while (place.value < topology_.node_count() && topology_.has_node(place)) ++place.value;
  return place;
}
TetIndex EditedOrgan::free_tet_place() const {
  TetIndex place(0);
  while (place.value < topology_.tet_count() &&
         (topology_.has_tet(place) || removed_.contains(place)))
    ++place.value;
  return place;
}

void EditedOrgan::edit() {
  if (topology_.has_links()) {
    if (below(4) == 0)
      split_node();
    else
      toggle_links();
  } else {
    switch (below(6)) {
      case 0:
        remove_tets(1 + below(12));
        break;
      case 1:
        restore_tets();
        break;
      case 2:
        split_node();
        break;
      case 3:
        nudge_node();
        break;
      default:
        bisect_edge();
    }
  }
  if (below(3) == 0) remove_bare_nodes();
}

void EditedOrgan::edit_without_growth() {
  if (below(2) == 0)
    split_node();
  else
    below(2) == 0 ? remove_tets(20) : restore_tets();
  remove_bare_nodes();
}

void EditedOrgan::remove_tets(std::size_t most) {
  const auto at = topology_.tets_of(any_node());
  const std::vector<TetIndex> tets(
      at.begin(), at.begin() + static_cast<std::ptrdiff_t>(std::min(most, at.size())));
  for (const auto t : tets) {
    removed_[t] = topology_.tet(t);
    topology_.remove_tet(t);
  }
}

void EditedOrgan::restore_tets() {
  // A node may be another by now, at the same number.
  const auto is_sound = [&](const mesh::Tet& tet) {
    return std::ranges::all_of(tet, [&](NodeIndex n) { return topology_.has_node(n); }) &&
           topology::tet_shape(topology_.rest(), tet).volume > 1e-12 &&
           topology::tet_shape(topology_.stress_free(), tet).volume > 1e-12;
  };
  for (const auto& [place, tet] : removed_)
    if (is_sound(tet)) topology_.put_tet(place, tet);
  removed_.clear();
}

void EditedOrgan::split_node() {
  const NodeIndex node = any_node(), copy = free_node_place();
  const auto at = topology_.regions_of(node);
  const std::vector<std::uint16_t> regions(at.begin(), at.end());
  topology_.put_node(copy, Vec3d(topology_.rest()[node.value]),
                     Vec3d(topology_.stress_free()[node.value]), regions);
  const auto tets_at = topology_.tets_of(node);
  const std::vector<TetIndex> tets(tets_at.begin(), tets_at.end());
  for (const auto t : tets) {
    if (below(2) == 0) continue;
    auto tet = topology_.tet(t);
    topology_.remove_tet(t);
    *std::ranges::find(tet, node) = copy;
    topology_.put_tet(t, tet);
  }
  const auto links_at = topology_.links_of(node);
  const std::vector<NodeIndex> others(links_at.begin(), links_at.end());
  for (const auto other : others) {
    if (below(2) == 0) continue;
    topology_.remove_link(node, other);
    topology_.put_link(copy, other);
  }
}

void EditedOrgan::bisect_edge() {
  const NodeIndex a = any_node();
  std::vector<NodeIndex> neighbours;
  topology_.neighbours_of(a, neighbours);
  if (neighbours.empty()) return;
  const NodeIndex b = neighbours[below(neighbours.size())], middle = free_node_place();
  const auto between = [&](std::span<const Vec3d> p) { return (p[a.value] + p[b.value]) * 0.5; };
  std::vector<std::uint16_t> regions;
  std::ranges::set_intersection(topology_.regions_of(a), topology_.regions_of(b),
                                std::back_inserter(regions));
  topology_.put_node(middle, between(topology_.rest()), between(topology_.stress_free()), regions);
  const auto at = topology_.tets_of(a);
  const std::vector<TetIndex> tets(at.begin(), at.end());
  for (const auto t : tets) {
    auto first = topology_.tet(t), second = first;
    const auto to = std::ranges::find(first, b);
    if (to == first.end()) continue;
    *to = middle;
    *std::ranges::find(second, a) = middle;
    topology_.remove_tet(t);
    topology_.put_tet(t, first);
    topology_.put_tet(free_tet_place(), second);
  }
}

void EditedOrgan::nudge_node() {
  const NodeIndex node = any_node();
  const Vec3d by{1e-5 * (below(21) - 10.0), 1e-5 * (below(21) - 10.0), 0};
  topology_.move_node(node, topology_.rest()[node.value] + by,
                      topology_.stress_free()[node.value] + by);
}

void EditedOrgan::toggle_links() {
  if (!removed_links_.empty() && below(2) == 0) {
    for (const auto& [a, b] : removed_links_)
      if (topology_.has_node(a) && topology_.has_node(b) &&
          !std::ranges::binary_search(topology_.links_of(a), b))
        topology_.put_link(a, b);
    removed_links_.clear();
    return;
  }
  const NodeIndex node = any_node();
  while (!topology_.links_of(node).empty() && below(4) != 0) {
    const NodeIndex other = topology_.links_of(node)[below(topology_.links_of(node).size())];
    topology_.remove_link(node, other);
    removed_links_.push_back({node, other});
  }
}

void EditedOrgan::remove_bare_nodes() {
  for (std::uint32_t n = 0; n < topology_.node_count(); ++n)
    if (topology_.has_node(NodeIndex(n)) && topology_.tets_of(NodeIndex(n)).empty() &&
        topology_.links_of(NodeIndex(n)).empty())
      topology_.remove_node(NodeIndex(n));
}

organ::Organ EditedOrgan::built_anew(std::vector<NodeIndex>& node_of) const {
  organ::Organ organ = organ_;
  const bool has_stress_free = !organ.stress_free_positions_m.empty();
  organ.mesh = {};
  organ.stress_free_positions_m.clear();
  organ.fixed_nodes.clear();
  organ.node_masses_kg.clear();
  for (auto& region : organ.regions) region.nodes.clear();
  node_of.clear();
  std::vector<NodeIndex> new_of(topology_.node_count());
  for (std::uint32_t n = 0; n < topology_.node_count(); ++n) {
    const NodeIndex node(n);
    if (!topology_.has_node(node)) continue;
    new_of[n] = NodeIndex(node_of.size());
    node_of.push_back(node);
    organ.mesh.rest_positions.push_back(topology_.rest()[n]);
    if (has_stress_free) organ.stress_free_positions_m.push_back(topology_.stress_free()[n]);
    for (const auto r : topology_.regions_of(node)) organ.regions[r].nodes.push_back(new_of[n]);
  }
  for (std::uint32_t t = 0; t < topology_.tet_count(); ++t) {
    if (!topology_.has_tet(TetIndex(t))) continue;
    auto tet = topology_.tet(TetIndex(t));
    for (auto& node : tet) node = new_of[node.value];
    organ.mesh.tets.push_back(tet);
  }
  for (const auto node : node_of)
    for (const auto other : topology_.links_of(node))
      if (node < other) organ.mesh.links.push_back({new_of[node.value], new_of[other.value]});
  organ.mesh.build_adjacency();
  return organ;
}

}  // namespace trocar::dynamics::testing
