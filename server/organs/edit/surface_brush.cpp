#include "server/organs/edit/surface_brush.h"

#include <algorithm>
#include <array>

namespace trocar::edit {

SurfaceBrush::SurfaceBrush(const mesh::TetMesh& mesh) : mesh_(mesh) {
  neighbours_.offsets.assign(mesh.node_count() + 1, 0);
  // The surface is closed, so that each of its edges leaves its first node in one triangle.
  for (const auto& triangle : mesh.boundary_triangles)
    for (const NodeIndex node : triangle) ++neighbours_.offsets[node.value + 1];
  for (std::size_t i = 0; i < mesh.node_count(); ++i)
    neighbours_.offsets[i + 1] += neighbours_.offsets[i];
  neighbours_.items.resize(neighbours_.offsets.back());
  auto next = neighbours_.offsets;
  for (const auto& [a, b, c] : mesh.boundary_triangles) {
    neighbours_.items[next[a.value]++] = b;
    neighbours_.items[next[b.value]++] = c;
    neighbours_.items[next[c.value]++] = a;
  }
  for (std::size_t i = 0; i < mesh.node_count(); ++i)
    std::sort(neighbours_.items.begin() + neighbours_.offsets[i],
              neighbours_.items.begin() + neighbours_.offsets[i + 1]);
}

std::vector<NodeIndex> SurfaceBrush::nodes_at(const SurfacePlace& place, double radius_m) const {
  if (place.triangle >= mesh_.boundary_triangles.size()) return {};
  const auto& corners = mesh_.boundary_triangles[place.triangle];
  const auto distance = [&](NodeIndex node) {
    return length(mesh_.rest_positions[node.value] - place.position_m);
  };
  std::vector<std::uint8_t> is_taken(mesh_.node_count());
  std::vector<NodeIndex> open, nodes;
  const auto take = [&](NodeIndex node) {
    if (is_taken[node.value] != 0) return;
    is_taken[node.value] = 1;
    open.push_back(node);
    nodes.push_back(node);
  };
  for (const NodeIndex corner : corners)
    if (distance(corner) <= radius_m) take(corner);
  if (nodes.empty())
    take(*std::min_element(corners.begin(), corners.end(),
                           [&](NodeIndex a, NodeIndex b) { return distance(a) < distance(b); }));
  while (!open.empty()) {
    const NodeIndex node = open.back();
    open.pop_back();
    for (const NodeIndex other : neighbours_[node])
      if (distance(other) <= radius_m) take(other);
  }
  std::sort(nodes.begin(), nodes.end());
  return nodes;
}

std::vector<NodeIndex> SurfaceBrush::nodes_below(const SurfacePlace& place, double radius_m,
                                                 double depth_m) const {
  auto nodes = nodes_at(place, radius_m);
  if (nodes.empty()) return nodes;
  const auto& [a, b, c] = mesh_.boundary_triangles[place.triangle];
  const auto& p = mesh_.rest_positions;
  const Vec3d outward =
      normalized(cross(p[b.value] - p[a.value], p[c.value] - p[a.value]), Vec3d{0, 1, 0});
  for (std::size_t i = 0; i < p.size(); ++i) {
    if (mesh_.is_surface_node[i] != 0) continue;
    const Vec3d from = p[i] - place.position_m;
    const double depth = -dot(from, outward);
    if (depth >= 0 && depth <= depth_m && length(from + outward * depth) <= radius_m)
      nodes.push_back(NodeIndex(i));
  }
  std::sort(nodes.begin(), nodes.end());
  return nodes;
}

}  // namespace trocar::edit
