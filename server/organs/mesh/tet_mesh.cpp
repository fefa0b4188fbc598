#include "server/organs/mesh/tet_mesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/math/box.h"

namespace trocar::mesh {
namespace {

constexpr int kTetEdges[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};

NodePair ordered_pair(NodeIndex a, NodeIndex b) {
  return a < b ? NodePair{a, b} : NodePair{b, a};
}

// Same winding, smallest node first: one spelling per oriented triangle.
Triangle rotated_to_smallest(const Triangle& t) {
  if (t[1] < t[0] && t[1] < t[2]) return {t[1], t[2], t[0]};
  if (t[2] < t[0] && t[2] < t[1]) return {t[2], t[0], t[1]};
  return t;
}

// Rows of the elements that contain each node. Elements are visited in order, so rows ascend.
template <typename Item, std::size_t kNodes>
Csr<NodeIndex, Item> incidence(std::size_t node_count,
                               const std::vector<std::array<NodeIndex, kNodes>>& elements) {
  Csr<NodeIndex, Item> csr;
  csr.offsets.assign(node_count + 1, 0);
  for (const auto& element : elements)
    for (const NodeIndex node : element) ++csr.offsets[node.value + 1];
  for (std::size_t i = 0; i < node_count; ++i) csr.offsets[i + 1] += csr.offsets[i];
  csr.items.resize(elements.size() * kNodes);
  std::vector<std::uint32_t> next(csr.offsets.begin(), csr.offsets.end() - 1);
  for (std::size_t e = 0; e < elements.size(); ++e)
    for (const NodeIndex node : elements[e]) csr.items[next[node.value]++] = Item(e);
  return csr;
}

// Pairs are in lexicographic order with a < b. For row n all pairs (a, n) come before all (n, b),
// and both kinds come in ascending order of the other node, so rows ascend.
Csr<NodeIndex, NodeIndex> neighbours(std::size_t node_count, const std::vector<NodePair>& pairs) {
  Csr<NodeIndex, NodeIndex> csr;
  csr.offsets.assign(node_count + 1, 0);
  for (const auto& [a, b] : pairs) ++csr.offsets[a.value + 1], ++csr.offsets[b.value + 1];
  for (std::size_t i = 0; i < node_count; ++i) csr.offsets[i + 1] += csr.offsets[i];
  csr.items.resize(pairs.size() * 2);
  std::vector<std::uint32_t> next(csr.offsets.begin(), csr.offsets.end() - 1);
  for (const auto& [a, b] : pairs) {
    csr.items[next[a.value]++] = b;
    csr.items[next[b.value]++] = a;
  }
  return csr;
}

std::vector<NodePair> distinct_edges(const std::vector<Tet>& tets) {
  std::vector<NodePair> edges;
  edges.reserve(tets.size() * 6);
  for (const Tet& tet : tets)
    for (const auto& [i, j] : kTetEdges) edges.push_back(ordered_pair(tet[i], tet[j]));
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  edges.shrink_to_fit();
  return edges;
}

// Faces that belong to exactly one tet, ordered by their sorted nodes.
std::vector<Triangle> boundary_faces(const std::vector<Tet>& tets) {
  struct Face {
    Triangle key, oriented;
  };
  std::vector<Face> faces;
  faces.reserve(tets.size() * 4);
  for (const Tet& tet : tets)
    for (const auto& [i, j, k] : kTetFaces) {
      Face face{{tet[i], tet[j], tet[k]}, {tet[i], tet[j], tet[k]}};
      std::sort(face.key.begin(), face.key.end());
      faces.push_back(face);
    }
  // Faces with equal keys are dropped together, so the order among them cannot reach the result.
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.key < b.key; });
  std::vector<Triangle> boundary;
  for (std::size_t i = 0; i < faces.size();) {
    std::size_t end = i + 1;
    while (end < faces.size() && faces[end].key == faces[i].key) ++end;
    if (end == i + 1) boundary.push_back(rotated_to_smallest(faces[i].oriented));
    i = end;
  }
  return boundary;
}

}  // namespace

void TetMesh::build_adjacency() {
  const std::size_t count = node_count();
  std::sort(links.begin(), links.end());
  edges = distinct_edges(tets);
  if (!tets.empty()) boundary_triangles = boundary_faces(tets);
  node_tets = incidence<TetIndex>(count, tets);
  node_edges = incidence<EdgeIndex>(count, edges);
  node_links = incidence<LinkIndex>(count, links);
  node_neighbours = neighbours(count, spring_pairs());
  is_surface_node.assign(count, 0);
  for (const Triangle& triangle : boundary_triangles)
    for (const NodeIndex node : triangle) is_surface_node[node.value] = 1;
  surface_nodes.clear();
  for (std::size_t i = 0; i < count; ++i)
    if (is_surface_node[i]) surface_nodes.push_back(NodeIndex(i));
}

double tet_volume(const TetMesh& mesh, TetIndex tet) {
  const auto& [a, b, c, d] = mesh.tets[tet.value];
  const Vec3d& origin = mesh.rest_positions[a.value];
  return dot(cross(mesh.rest_positions[b.value] - origin, mesh.rest_positions[c.value] - origin),
             mesh.rest_positions[d.value] - origin) /
         6.0;
}

double total_volume(const TetMesh& mesh) {
  double sum = 0;
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) sum += tet_volume(mesh, TetIndex(i));
  return sum;
}

Vec3d centre_on_origin(TetMesh& mesh) {
  trocar::Box<double> box;
  for (const Vec3d& p : mesh.rest_positions) box.include(p);
  const Vec3d centre = box.least + (box.most - box.least) * 0.5;
  for (Vec3d& p : mesh.rest_positions) p -= centre;
  return centre;
}

std::vector<Vec3d> surface_normals(const TetMesh& mesh) {
  std::vector<Vec3d> normals(mesh.node_count());
  for (const auto& [a, b, c] : mesh.boundary_triangles) {
    const Vec3d& origin = mesh.rest_positions[a.value];
    const Vec3d twice_area =
        cross(mesh.rest_positions[b.value] - origin, mesh.rest_positions[c.value] - origin);
    normals[a.value] += twice_area;
    normals[b.value] += twice_area;
    normals[c.value] += twice_area;
  }
  for (Vec3d& normal : normals) normal = normalized(normal, Vec3d{});
  return normals;
}

DihedralRange dihedral_range(const TetMesh& mesh, const Tet& tet) {
  double largest_cosine = -1, smallest_cosine = 1;
  Vec3d normals[4];
  for (int f = 0; f < 4; ++f) {
    const auto& [i, j, k] = kTetFaces[f];
    const Vec3d& origin = mesh.rest_positions[tet[i].value];
    normals[f] = normalized(cross(mesh.rest_positions[tet[j].value] - origin,
                                  mesh.rest_positions[tet[k].value] - origin),
                            Vec3d{});
  }
  // The angle inside between two faces is 180 degrees less the angle between outward normals.
  for (const auto& [i, j] : kTetEdges) {
    const double cosine = -dot(normals[i], normals[j]);
    largest_cosine = std::max(largest_cosine, cosine);
    smallest_cosine = std::min(smallest_cosine, cosine);
  }
  const auto degrees = [](double cosine) {
    return std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi;
  };
  return {degrees(largest_cosine), degrees(smallest_cosine)};
}

DihedralRange dihedral_range(const TetMesh& mesh) {
  DihedralRange all;
  for (const Tet& tet : mesh.tets) {
    const auto range = dihedral_range(mesh, tet);
    all.min_deg = std::min(all.min_deg, range.min_deg);
    all.max_deg = std::max(all.max_deg, range.max_deg);
  }
  return all;
}

std::array<std::size_t, kDihedralClasses> dihedral_histogram(const TetMesh& mesh) {
  std::array<std::size_t, kDihedralClasses> counts{};
  for (const Tet& tet : mesh.tets) {
    const double angle = dihedral_range(mesh, tet).min_deg;
    ++counts[std::min(static_cast<std::size_t>(angle / 10), kDihedralClasses - 1)];
  }
  return counts;
}

}  // namespace trocar::mesh
