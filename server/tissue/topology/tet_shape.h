#pragma once

// Rest geometry of one linear tet: volume and gradients of its shape functions.

#include <array>

#include "server/tissue/topology/topology.h"

namespace trocar::topology {

struct TetShape {
  double volume = 0;               // m^3
  std::array<Vec3d, 4> gradients;  // 1/m; they sum to zero
};
TetShape tet_shape(std::span<const Vec3d> positions, const mesh::Tet& tet);

// Returns the shape in which tissue is free of stress once a tet is on its own: the topology's,
// stretched by
//   A = (1 - tension) I - fibre_tension f f^T,   f the fibres' direction,
// so that lengths are to first order those of springs under the same tension (Nakao 2003 eq. 3).
// corners: the tet's nodes in any order of the same orientation, that of the gradients.
TetShape stress_free_shape(const Topology& topology, TetIndex tet, const mesh::Tet& corners);
// A times a vector; fibres: of any length, zero: none.
Vec3d relaxed(const material::Material& material, const Vec3d& fibres, const Vec3d& vector);

}  // namespace trocar::topology
