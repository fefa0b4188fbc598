#include "server/tissue/topology/topology.h"

#include <algorithm>

#include "common/base/assert.h"
#include "server/tissue/topology/tet_shape.h"

namespace trocar::topology {
namespace {

// Ascending lists as blocks.
template <typename T>
void insert(Blocks<T>& lists, NodeIndex node, const T& item) {
  const auto old = static_cast<std::uint32_t>(lists[node.value].size());
  const auto list = lists.resize(node.value, old + 1);
  const auto end = list.end() - 1;
  const auto at = std::lower_bound(list.begin(), end, item);
  TROCAR_ASSERT(at == end || *at != item);
  std::copy_backward(at, end, list.end());
  *at = item;
}

template <typename T>
void erase(Blocks<T>& lists, NodeIndex node, const T& item) {
  const auto list = lists[node.value];
  const auto at = std::lower_bound(list.begin(), list.end(), item);
  TROCAR_ASSERT(at != list.end() && *at == item);
  std::copy(at + 1, list.end(), at);
  lists.resize(node.value, static_cast<std::uint32_t>(list.size() - 1));
}

Vec3d axis_of(const mesh::Tet& tet, std::span<const Vec3d> node_axes) {
  std::array<Vec3d, 4> axes;
  for (std::size_t i = 0; i < 4; ++i) axes[i] = node_axes[tet[i].value];
  return organ::sum_of_axes(axes);
}

template <typename T>
void assign(Blocks<T>& lists, NodeIndex node, std::span<const T> items) {
  std::ranges::copy(items,
                    lists.resize(node.value, static_cast<std::uint32_t>(items.size())).begin());
}

}  // namespace

Topology::Topology(const organ::Organ& organ)
    : organ_(organ),
      has_fibre_axes_(!organ.fibre_directions.empty()),
      rest_(organ.mesh.rest_positions),
      stress_free_(organ.stress_free()),
      node_axes_(organ.fibre_directions),
      tets_(organ.mesh.tets),
      tet_materials_(organ::material_map(organ).tets),
      wound_faces_(organ.mesh.tets.size()),
      has_node_(organ.mesh.node_count(), 1),
      is_changed_(organ.mesh.node_count()),
      ties_(organ) {
  const auto& mesh = organ.mesh;
  node_tets_.reserve(mesh.node_tets.items.size());
  node_links_.reserve(mesh.node_links.items.size());
  node_tets_.extend(node_count());
  node_links_.extend(node_count());
  node_regions_.extend(node_count());
  std::vector<NodeIndex> others;
  for (std::uint32_t n = 0; n < node_count(); ++n) {
    const NodeIndex node(n);
    assign(node_tets_, node, mesh.node_tets[node]);
    others.clear();
    for (const auto link : mesh.node_links[node]) {
      const auto& [a, b] = mesh.links[link.value];
      others.push_back(a == node ? b : a);
    }
    std::ranges::sort(others);
    assign(node_links_, node, std::span<const NodeIndex>(others));
  }
  node_tets_.end_building();
  node_links_.end_building();
  node_regions_.end_building();
  if (has_fibre_axes_)
    for (const auto& tet : tets_) tet_axes_.push_back(axis_of(tet, node_axes_));
  for (std::size_t r = 0; r < organ.regions.size(); ++r)
    for (const auto node : organ.regions[r].nodes)
      insert(node_regions_, node, static_cast<std::uint16_t>(r));
}

void Topology::neighbours_of(NodeIndex node, std::vector<NodeIndex>& out) const {
  out.clear();
  // A neighbour shares about five tets: fewer to sort if each is taken once.
  for_each_neighbour(node, [&](NodeIndex j) {
    if (std::ranges::find(out, j) == out.end()) out.push_back(j);
  });
  std::ranges::sort(out);
}

std::uint16_t Topology::material_of_all(std::span<const NodeIndex> nodes) const {
  const auto regions = regions_of(nodes[0]);
  for (auto i = regions.size(); i-- > 0;)
    if (std::ranges::all_of(nodes.subspan(1), [&](NodeIndex n) {
          return std::ranges::binary_search(regions_of(n), regions[i]);
        }))
      return static_cast<std::uint16_t>(regions[i] + 1);
  return 0;
}
std::uint16_t Topology::material_of(NodeIndex node) const {
  return material_of_all(std::array{node});
}
std::uint16_t Topology::material_of(NodeIndex a, NodeIndex b) const {
  return material_of_all(std::array{a, b});
}

Vec3d Topology::fibre_axis(NodeIndex a, NodeIndex b) const {
  return has_fibre_axes_ ? organ::sum_of_axes(std::array{node_axes_[a.value], node_axes_[b.value]})
                         : Vec3d{};
}

void Topology::set_fibre_axis(NodeIndex node, const Vec3d& axis) {
  if (has_fibre_axes_) node_axes_[node.value] = axis;
}
void Topology::set_fibre_axis(TetIndex tet, const Vec3d& axis) {
  if (has_fibre_axes_) tet_axes_[tet.value] = axis;
}

double Topology::lumped_mass(NodeIndex node) const {
  double mass = 0;
  for (const auto t : tets_of(node))
    mass += organ::material_at(organ_, material_of(t)).density_kg_m3 *
            tet_shape(stress_free_, tet(t)).volume / 4;
  return mass;
}

void Topology::put_node(NodeIndex place, const Vec3d& rest, const Vec3d& stress_free,
                        std::span<const std::uint16_t> regions) {
  TROCAR_ASSERT(place.value <= node_count());
  if (place.value == node_count()) {
    rest_.emplace_back();
    stress_free_.emplace_back();
    if (has_fibre_axes_) node_axes_.emplace_back();
    has_node_.push_back(0);
    is_changed_.push_back(0);
    node_tets_.extend(node_count());
    node_links_.extend(node_count());
    node_regions_.extend(node_count());
  }
  TROCAR_ASSERT(!has_node(place));
  rest_[place.value] = rest;
  stress_free_[place.value] = stress_free;
  set_fibre_axis(place, {});
  has_node_[place.value] = 1;
  assign(node_regions_, place, regions);
  mark(place);
}

void Topology::remove_node(NodeIndex node) {
  TROCAR_ASSERT(has_node(node) && tets_of(node).empty() && links_of(node).empty());
  has_node_[node.value] = 0;
  node_regions_.resize(node.value, 0);
  mark(node);
}

void Topology::move_node(NodeIndex node, const Vec3d& rest, const Vec3d& stress_free) {
  TROCAR_ASSERT(has_node(node));
  rest_[node.value] = rest;
  stress_free_[node.value] = stress_free;
  mark(node);
  for_each_neighbour(node, [&](NodeIndex j) { mark(j); });
}

void Topology::put_tet(TetIndex place, const mesh::Tet& tet) {
  TROCAR_ASSERT(place.value <= tet_count());
  if (place.value == tet_count()) {
    tets_.emplace_back();
    tet_materials_.push_back(0);
    wound_faces_.push_back(0);
    if (has_fibre_axes_) tet_axes_.emplace_back();
  }
  TROCAR_ASSERT(!has_tet(place));
  tets_[place.value] = tet;
  tet_materials_[place.value] = material_of_all(tet);
  wound_faces_[place.value] = 0;
  if (has_fibre_axes_) tet_axes_[place.value] = axis_of(tet, node_axes_);
  for (const auto node : tet) {
    TROCAR_ASSERT(has_node(node));
    insert(node_tets_, node, place);
    mark(node);
  }
}

void Topology::remove_tet(TetIndex tet) {
  TROCAR_ASSERT(has_tet(tet));
  for (const auto node : tets_[tet.value]) {
    erase(node_tets_, node, tet);
    mark(node);
  }
  tets_[tet.value] = {};
}

void Topology::put_link(NodeIndex a, NodeIndex b) {
  TROCAR_ASSERT(has_links() && has_node(a) && has_node(b) && a != b);
  insert(node_links_, a, b);
  insert(node_links_, b, a);
  mark(a);
  mark(b);
}

void Topology::remove_link(NodeIndex a, NodeIndex b) {
  erase(node_links_, a, b);
  erase(node_links_, b, a);
  mark(a);
  mark(b);
}

void Topology::mark(NodeIndex node) {
  if (is_changed_[node.value]) return;
  is_changed_[node.value] = 1;
  changed_.push_back(node);
}

void Topology::clear_changes() {
  for (const auto node : changed_) is_changed_[node.value] = 0;
  changed_.clear();
  parts_.clear();
  node_tets_.tidy();
  node_links_.tidy();
  node_regions_.tidy();
}

}  // namespace trocar::topology
