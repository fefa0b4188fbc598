#include "common/wire/surface_layout.h"

#include <algorithm>

#include "common/base/assert.h"
#include "common/math/morton.h"

namespace trocar::wire {

std::uint64_t SurfaceLayout::compute_triangle_sum() const {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < triangles.size(); ++i)
    if (has_triangle(TriangleIndex(i)))
      sum += triangle_hash(TriangleIndex(i), triangles[i], is_wound[i] != 0);
  return sum;
}

SurfaceLayout make_surface_layout(std::span<const Vec3d> rest_m,
                                  std::span<const NodeIndex> surface_nodes,
                                  std::span<const std::array<NodeIndex, 3>> triangles,
                                  std::span<const NodeIndex> fixed_nodes) {
  std::vector<Vec3d> positions;
  positions.reserve(surface_nodes.size());
  for (const NodeIndex node : surface_nodes) positions.push_back(rest_m[node.value]);

  SurfaceLayout layout;
  layout.vertex_of_node.resize(rest_m.size());
  std::vector<Vec3d> positions_by_slot;
  positions_by_slot.reserve(positions.size());
  for (const std::uint32_t i : morton_order(positions)) {
    const NodeIndex node = surface_nodes[i];
    layout.vertex_of_node[node.value] = VertexIndex(layout.node_of_vertex.size());
    layout.node_of_vertex.push_back(node);
    positions_by_slot.push_back(positions[i]);
  }
  layout.rest_quanta = quantise_rest(positions_by_slot);

  layout.triangles.reserve(triangles.size());
  for (const auto& triangle : triangles) {
    auto& slots = layout.triangles.emplace_back();
    for (std::size_t corner = 0; corner < 3; ++corner) {
      slots[corner] = layout.vertex_of_node[triangle[corner].value];
      TROCAR_ASSERT(slots[corner].is_valid());
    }
  }
  layout.is_wound.resize(layout.triangles.size());
  layout.triangle_sum = layout.compute_triangle_sum();
  for (const NodeIndex node : fixed_nodes)
    if (const VertexIndex vertex = layout.vertex_of_node[node.value]; vertex.is_valid())
      layout.fixed_vertices.push_back(vertex);
  std::sort(layout.fixed_vertices.begin(), layout.fixed_vertices.end());
  return layout;
}

}  // namespace trocar::wire
