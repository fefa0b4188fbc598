#pragma once

// Faces, edges and shapes of tets, read from a topology.

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "server/tissue/topology/topology.h"

namespace trocar::cutting {

// A face is given by a tet and the corner opposite to the face.
struct TetFace {
  TetIndex tet;
  std::uint8_t corner = 0;

  auto operator<=>(const TetFace&) const = default;
};

// Returns 0 to 3, or 4 if the tet does not have the node.
inline std::uint8_t corner_of(const mesh::Tet& tet, NodeIndex node) {
  std::uint8_t corner = 0;
  while (corner < 4 && tet[corner] != node) ++corner;
  return corner;
}

// In the tet's order of corners.
inline mesh::Triangle face_nodes(const mesh::Tet& tet, std::uint8_t corner) {
  mesh::Triangle nodes;
  for (std::size_t i = 0, at = 0; i < 4; ++i)
    if (i != corner) nodes[at++] = tet[i];
  return nodes;
}

// The same face seen from the tet on its other side.
std::optional<TetFace> across(const topology::Topology& topology, const TetFace& face);

// Tets at an edge, ascending.
void ring_of(const topology::Topology& topology, NodeIndex a, NodeIndex b,
             std::vector<TetIndex>& out);

double face_area(const topology::Topology& topology, const TetFace& face);  // at rest, m^2

// Six times the volume; positive in the order of mesh::Tet.
double six_volumes(const std::array<Vec3d, 4>& corners);
// The smallest sine of a dihedral angle: V6 l / (4 A1 A2), l the shared edge, A1 and A2 the faces;
// negative for an inverted tet.
double least_sine(const std::array<Vec3d, 4>& corners);
std::array<Vec3d, 4> rest_corners(const topology::Topology& topology, const mesh::Tet& tet);

// Rounds a share of an edge, 0 to 1, to units of 1/65536; the result is short of the edge's end.
std::uint16_t quantised_share(double share);
// Returns the point t/65536 of the way from a to b.
inline Vec3d along(const Vec3d& a, const Vec3d& b, std::uint16_t t) {
  return a + (b - a) * (t / 65536.0);
}

}  // namespace trocar::cutting
