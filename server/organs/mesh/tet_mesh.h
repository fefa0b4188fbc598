#pragma once

// Tetrahedral mesh: nodes, tets, edges, boundary triangles, links, and compact adjacency.
//
// Given: rest positions, tets, links (springs; separate from tets, a lattice has links only) and,
// for a mesh without tets, boundary triangles. Derived by build_adjacency(): edges, boundary
// triangles of the tets, and the lists below. Invariants, all checked by validate():
//   - every index is in range; a tet has four distinct nodes and positive rest volume, no tet
//   twice;
//   - edges are the distinct node pairs of the tets, (a < b), in lexicographic order;
//   - links are distinct node pairs (a < b), in lexicographic order;
//   - boundary triangles face outward and form closed surfaces: each directed edge once, its
//   reverse
//     once; with tets they are exactly the faces that belong to one tet; each edge of the surface
//     has exactly two triangles (manifold);
//   - adjacency equals what the elements say, rows ascending; every node is used.
// Complexity of build_adjacency: O(n log n). Not thread-safe; a const mesh may be read by any
// thread.

#include <array>
#include <vector>

#include "common/base/index.h"
#include "common/base/result.h"
#include "common/math/vec3.h"
#include "server/organs/mesh/csr.h"

namespace trocar::mesh {

using Tet = std::array<NodeIndex, 4>;       // positive volume: (b-a) x (c-a) . (d-a) > 0
using NodePair = std::array<NodeIndex, 2>;  // a < b
using Triangle = std::array<NodeIndex, 3>;  // counter-clockwise seen from outside

// Corners of a tet's faces, each counter-clockwise seen from outside.
inline constexpr int kTetFaces[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};

struct TetMesh {
  std::vector<Vec3d> rest_positions;  // m, world frame, node_count
  std::vector<Tet> tets;
  std::vector<NodePair> links;
  std::vector<Triangle> boundary_triangles;

  // Derived.
  std::vector<NodePair> edges;
  Csr<NodeIndex, TetIndex> node_tets;
  Csr<NodeIndex, EdgeIndex> node_edges;
  Csr<NodeIndex, LinkIndex> node_links;
  // Neighbours along which force propagates: over links if the mesh has any, else over tet edges.
  Csr<NodeIndex, NodeIndex> node_neighbours;
  // Surface nodes, ascending, and per node whether it is one.
  std::vector<NodeIndex> surface_nodes;
  std::vector<std::uint8_t> is_surface_node;

  std::size_t node_count() const { return rest_positions.size(); }
  // Node pairs that carry springs: links if the mesh has any, else tet edges.
  const std::vector<NodePair>& spring_pairs() const { return links.empty() ? edges : links; }

  // Fills everything under "Derived", sorts `links`, and, if there are tets, replaces
  // `boundary_triangles` by the faces that belong to exactly one tet. Requires valid indices.
  void build_adjacency();

  bool operator==(const TetMesh&) const = default;
};

// Error names the first broken invariant and the element; ok when all hold.
Status validate(const TetMesh& mesh);

// Signed rest volume of a tet, m^3.
double tet_volume(const TetMesh& mesh, TetIndex tet);
double total_volume(const TetMesh& mesh);
// Moves the centre of the rest bounding box to the origin; returns the old centre. Needs a node.
Vec3d centre_on_origin(TetMesh& mesh);
// Area-weighted outward surface normal per node, unit length (zero for interior nodes).
std::vector<Vec3d> surface_normals(const TetMesh& mesh);

struct DihedralRange {
  double min_deg = 180, max_deg = 0;
};
DihedralRange dihedral_range(const TetMesh& mesh);
DihedralRange dihedral_range(const TetMesh& mesh, const Tet& tet);
// How many tets have their smallest dihedral angle in each class of 10 degrees; that of a regular
// tet is 70.5 degrees.
inline constexpr std::size_t kDihedralClasses = 8;
std::array<std::size_t, kDihedralClasses> dihedral_histogram(const TetMesh& mesh);

}  // namespace trocar::mesh
