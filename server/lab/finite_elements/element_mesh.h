#pragma once

// Tetrahedra of four nodes (linear) or ten (quadratic, straight edges at rest), made from a tet
// mesh. Corners keep the mesh's numbers; the node in the middle of edges[i] is node_count + i.
//
// Order of an element's nodes: corners 0 to 3, then the middles of edges 01, 12, 20, 03, 13, 23
// (that of VTK's quadratic tetra and of CalculiX's C3D10). Immutable once made: any thread.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/organs/mesh/tet_mesh.h"

namespace trocar::finite_elements {

enum class ElementOrder : std::uint8_t { Linear = 1, Quadratic = 2 };

inline constexpr std::size_t kMaxElementNodes = 10;
// Corners at the ends of middle node 4 + i.
inline constexpr std::array<std::array<int, 2>, 6> kElementEdges{
    {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}}};

struct ElementMesh {
  ElementOrder order = ElementOrder::Linear;
  std::size_t corner_count = 0;
  std::vector<Vec3d> rest_positions;                    // m; corners first
  std::vector<std::array<std::uint32_t, 2>> edge_ends;  // corners beside node corner_count + i
  std::vector<std::uint32_t> nodes;                     // nodes_per_element() of each

  // Each element has the gradients of its four barycentric coordinates (rows), 1/m, and a volume,
  // m^3.
  std::vector<Eigen::Matrix<double, 4, 3>> gradients;
  std::vector<double> volumes;

  std::size_t nodes_per_element() const { return order == ElementOrder::Linear ? 4 : 10; }
  // One in the centroid, or four that are exact for quadratic functions.
  std::size_t points_per_element() const { return order == ElementOrder::Linear ? 1 : 4; }
  std::size_t node_count() const { return rest_positions.size(); }
  std::size_t element_count() const { return volumes.size(); }
  std::span<const std::uint32_t> nodes_of(std::size_t element) const {
    return {nodes.data() + element * nodes_per_element(), nodes_per_element()};
  }
};

// The mesh must be valid and its adjacency built. `rest_positions_m`: where it is free of stress,
// as many as the mesh has nodes, all tets of positive volume.
ElementMesh make_elements(const mesh::TetMesh& mesh, std::span<const Vec3d> rest_positions_m,
                          ElementOrder order);

// The node in the middle of an edge of the mesh, of quadratic elements.
std::uint32_t middle_node(const mesh::TetMesh& mesh, NodeIndex a, NodeIndex b);

// Barycentric coordinates of the quadrature points; each stands for an equal share of the volume.
std::span<const std::array<double, 4>> quadrature_points(ElementOrder order);

// Gradients of the shape functions at a quadrature point, one row per node.
template <int Nodes>
Eigen::Matrix<double, Nodes, 3> shape_gradients(const Eigen::Matrix<double, 4, 3>& g,
                                                const std::array<double, 4>& l) {
  if constexpr (Nodes == 4) {
    return g;
  } else {
    Eigen::Matrix<double, 10, 3> d;
    for (int i = 0; i < 4; ++i) d.row(i) = (4 * l[static_cast<std::size_t>(i)] - 1) * g.row(i);
    for (int i = 0; i < 6; ++i) {
      const auto [a, b] = kElementEdges[static_cast<std::size_t>(i)];
      d.row(4 + i) = 4 * (l[static_cast<std::size_t>(a)] * g.row(b) +
                          l[static_cast<std::size_t>(b)] * g.row(a));
    }
    return d;
  }
}

// Mass of a tet of unit density and volume between two of its nodes: lumped in corners for linear
// elements, as in the live solver; consistent for quadratic ones, whose lumped corners would be
// negative.
double mass_share(ElementOrder order, std::size_t a, std::size_t b);

}  // namespace trocar::finite_elements
