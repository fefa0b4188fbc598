#include "server/lab/finite_elements/surface_traction.h"

namespace trocar::finite_elements {
namespace {

// add(node, normal area of the node's share) for each node that carries a part of a face.
template <typename Add>
void for_each_share(const mesh::TetMesh& mesh, const ElementMesh& elements,
                    std::span<const std::uint8_t> is_selected, Add add) {
  for (const auto& triangle : mesh.boundary_triangles) {
    const auto [a, b, c] = triangle;
    if (!is_selected[a.value] || !is_selected[b.value] || !is_selected[c.value]) continue;
    const auto& p = elements.rest_positions;
    const Vec3d share = cross(p[b.value] - p[a.value], p[c.value] - p[a.value]) * (0.5 / 3);
    for (std::size_t i = 0; i < 3; ++i)
      add(elements.order == ElementOrder::Linear
              ? triangle[i].value
              : middle_node(mesh, triangle[i], triangle[(i + 1) % 3]),
          share);
  }
}

}  // namespace

std::vector<double> area_shares(const mesh::TetMesh& mesh, const ElementMesh& elements,
                                std::span<const std::uint8_t> is_selected) {
  std::vector<double> shares(elements.node_count(), 0.0);
  for_each_share(mesh, elements, is_selected,
                 [&](std::uint32_t node, const Vec3d& area) { shares[node] += length(area); });
  return shares;
}

std::vector<Vec3d> normal_area_shares(const mesh::TetMesh& mesh, const ElementMesh& elements,
                                      std::span<const std::uint8_t> is_selected) {
  std::vector<Vec3d> shares(elements.node_count());
  for_each_share(mesh, elements, is_selected,
                 [&](std::uint32_t node, const Vec3d& area) { shares[node] += area; });
  return shares;
}

}  // namespace trocar::finite_elements
