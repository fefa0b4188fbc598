#include "server/lab/finite_elements/element_mesh.h"

#include <Eigen/LU>
#include <algorithm>

#include "common/base/assert.h"

namespace trocar::finite_elements {
namespace {

void add_geometry(ElementMesh& elements, const mesh::Tet& tet) {
  const auto& p = elements.rest_positions;
  const auto point = [&](std::size_t i) {
    const Vec3d& a = p[tet[i].value];
    return Eigen::RowVector3d(a.x, a.y, a.z);
  };
  Eigen::Matrix3d sides;  // rows: from corner 0
  for (std::size_t i = 0; i < 3; ++i) sides.row(static_cast<int>(i)) = point(i + 1) - point(0);
  const Eigen::Matrix3d inverse = sides.inverse();
  Eigen::Matrix<double, 4, 3> g;
  g.bottomRows<3>() = inverse.transpose();
  g.row(0) = -g.bottomRows<3>().colwise().sum();
  elements.gradients.push_back(g);
  elements.volumes.push_back(sides.determinant() / 6);
  TROCAR_ASSERT(elements.volumes.back() > 0);
}

}  // namespace

std::uint32_t middle_node(const mesh::TetMesh& mesh, NodeIndex a, NodeIndex b) {
  const mesh::NodePair pair{std::min(a, b), std::max(a, b)};
  const auto found = std::lower_bound(mesh.edges.begin(), mesh.edges.end(), pair);
  TROCAR_ASSERT(found != mesh.edges.end() && *found == pair);
  return static_cast<std::uint32_t>(mesh.node_count()) +
         static_cast<std::uint32_t>(found - mesh.edges.begin());
}

ElementMesh make_elements(const mesh::TetMesh& mesh, std::span<const Vec3d> rest_positions_m,
                          ElementOrder order) {
  TROCAR_ASSERT(rest_positions_m.size() == mesh.node_count());
  ElementMesh elements;
  elements.order = order;
  elements.corner_count = mesh.node_count();
  elements.rest_positions.assign(rest_positions_m.begin(), rest_positions_m.end());
  if (order == ElementOrder::Quadratic)
    for (const auto& [a, b] : mesh.edges) {
      elements.edge_ends.push_back({a.value, b.value});
      elements.rest_positions.push_back((rest_positions_m[a.value] + rest_positions_m[b.value]) *
                                        0.5);
    }
  for (const auto& tet : mesh.tets) {
    for (const auto node : tet) elements.nodes.push_back(node.value);
    if (order == ElementOrder::Quadratic)
      for (const auto& [a, b] : kElementEdges)
        elements.nodes.push_back(
            middle_node(mesh, tet[static_cast<std::size_t>(a)], tet[static_cast<std::size_t>(b)]));
    add_geometry(elements, tet);
  }
  return elements;
}

std::span<const std::array<double, 4>> quadrature_points(ElementOrder order) {
  static constexpr std::array<std::array<double, 4>, 1> kCentroid{{{0.25, 0.25, 0.25, 0.25}}};
  constexpr double kNear = 0.58541019662496845, kFar = 0.13819660112501052;  // (5 +- sqrt 5) / 20
  static constexpr std::array<std::array<double, 4>, 4> kFour{{{kNear, kFar, kFar, kFar},
                                                               {kFar, kNear, kFar, kFar},
                                                               {kFar, kFar, kNear, kFar},
                                                               {kFar, kFar, kFar, kNear}}};
  if (order == ElementOrder::Linear) return kCentroid;
  return kFour;
}

double mass_share(ElementOrder order, std::size_t a, std::size_t b) {
  if (order == ElementOrder::Linear) return a == b ? 0.25 : 0;
  // Integrals of products of the shape functions, in parts of 420.
  constexpr double kPart = 1.0 / 420;
  if (a > b) std::swap(a, b);
  if (b < 4) return (a == b ? 6 : 1) * kPart;
  const auto& end = kElementEdges[b - 4];
  const auto is_end = [&end](int corner) { return end[0] == corner || end[1] == corner; };
  if (a < 4) return (is_end(static_cast<int>(a)) ? -4 : -6) * kPart;
  if (a == b) return 32 * kPart;
  const auto& other = kElementEdges[a - 4];
  return (is_end(other[0]) || is_end(other[1]) ? 16 : 8) * kPart;
}

}  // namespace trocar::finite_elements
