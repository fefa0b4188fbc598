#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/mesh/pieces.h"

namespace trocar::catalogue {
namespace {

constexpr int kCells = 24;  // along x and z; one layer of them in y
constexpr double kSide_m = 0.16, kThickness_m = 0.004;
constexpr int kColumns = kCells + 1;

using Corners = std::array<NodeIndex, 8>;  // bit 0: greater x, bit 1: greater y, bit 2: greater z

NodeIndex plate_node(int i, int j, int k) {
  return NodeIndex(i + kColumns * (j + 2 * k));
}

// The corners of a cell as it would look in a mirror for odd i, and again for odd k: cut into tets
// alike, neighbours then meet in mirrored, that is equal, faces, and no diagonal is preferred.
Corners corners_of(int i, int k) {
  Corners corners{};
  for (int c = 0; c < 8; ++c) {
    const int x = c & 1, y = c >> 1 & 1, z = c >> 2 & 1;
    corners[static_cast<std::size_t>(c)] =
        plate_node(i + (i % 2 ? 1 - x : x), y, k + (k % 2 ? 1 - z : z));
  }
  return corners;
}

// One cell in each block of 6 x 3 has a node in its middle. From row to row of blocks it moves so
// that these nodes are evenly spread, and that as many are in mirrored cells as in others.
bool has_middle_node(int i, int k) {
  constexpr int kPlaces[4] = {1, 4, 2, 5};
  return k % 3 == 1 && i % 6 == kPlaces[k / 3 % 4];
}

void add_tet(mesh::TetMesh& mesh, NodeIndex a, NodeIndex b, NodeIndex c, NodeIndex d) {
  const auto at = [&](NodeIndex node) { return mesh.rest_positions[node.value]; };
  const double volume = dot(cross(at(b) - at(a), at(c) - at(a)), at(d) - at(a));
  if (volume < 0) std::swap(c, d);
  mesh.tets.push_back({a, b, c, d});
}

// Six tets around the diagonal from corner 0 to corner 7.
void add_plain_cell(mesh::TetMesh& mesh, const Corners& c) {
  constexpr std::size_t kPath[6][2] = {{1, 3}, {3, 2}, {2, 6}, {6, 4}, {4, 5}, {5, 1}};
  for (const auto& [a, b] : kPath) add_tet(mesh, c[0], c[a], c[b], c[7]);
}

// Twelve tets between the middle and the faces; each face has the diagonal that the six tets of a
// plain cell would give it.
void add_cell_with_middle(mesh::TetMesh& mesh, const Corners& c) {
  constexpr std::size_t kFaces[6][4] = {{0, 1, 3, 2}, {0, 2, 6, 4}, {0, 4, 5, 1},
                                        {1, 3, 7, 5}, {2, 6, 7, 3}, {4, 5, 7, 6}};
  Vec3d middle{};
  for (const NodeIndex corner : c) middle = middle + mesh.rest_positions[corner.value] * 0.125;
  const NodeIndex node(mesh.node_count());
  mesh.rest_positions.push_back(middle);
  for (const auto& f : kFaces) {
    add_tet(mesh, node, c[f[0]], c[f[1]], c[f[2]]);
    add_tet(mesh, node, c[f[0]], c[f[2]], c[f[3]]);
  }
}

mesh::TetMesh plate_mesh() {
  mesh::TetMesh mesh;
  for (int k = 0; k < kColumns; ++k)
    for (int j = 0; j < 2; ++j)
      for (int i = 0; i < kColumns; ++i)
        mesh.rest_positions.push_back({(2.0 * i / kCells - 1) * (kSide_m / 2),
                                       (j - 0.5) * kThickness_m,
                                       (2.0 * k / kCells - 1) * (kSide_m / 2)});
  for (int k = 0; k < kCells; ++k)
    for (int i = 0; i < kCells; ++i) {
      const Corners corners = corners_of(i, k);
      if (has_middle_node(i, k))
        add_cell_with_middle(mesh, corners);
      else
        add_plain_cell(mesh, corners);
    }
  mesh::renumber_along_z(mesh);
  mesh.build_adjacency();
  return mesh;
}

}  // namespace

organ::Organ make_plate() {
  organ::Organ organ;
  organ.name = "plate";
  organ.source = "plate of Nakao 2003, 16 x 16 x 0.4 cm";
  organ.mesh = plate_mesh();
  organ.material.density_kg_m3 = 900;
  organ.material.spring_law = material::SpringLaw::Constant;
  organ.material.spring_stiffness_n_m = 100;
  organ.material.young_modulus_pa = 58'000;
  organ.material.edge_damping_time_s = 0.05 / 100;
  organ.node_masses_kg = organ::lumped_masses(organ);
  for (std::size_t n = 0; n < organ.mesh.node_count(); ++n) {
    const Vec3d& p = organ.mesh.rest_positions[n];
    if (std::max(std::abs(p.x), std::abs(p.z)) > kSide_m / 2 - 1e-9)
      organ.fixed_nodes.push_back(NodeIndex(n));
  }
  TROCAR_ASSERT(validate(organ));
  return organ;
}

}  // namespace trocar::catalogue
