#pragma once

// A cell of a grid, filled with five tets; cells whose indices have an odd sum are mirrored, so
// that the diagonals of neighbours meet.

#include <utility>

#include "server/organs/mesh/tet_mesh.h"

namespace trocar::catalogue {

// node_at(i, j, k): the NodeIndex of a corner, whose position the mesh has.
template <typename NodeAt>
void add_five_tets(mesh::TetMesh& mesh, int i, int j, int k, NodeAt node_at) {
  // Corners: bit 0 greater x, bit 1 greater y, bit 2 greater z.
  constexpr int kFive[5][4] = {
      {0, 1, 2, 4}, {3, 2, 1, 7}, {5, 4, 7, 1}, {6, 7, 4, 2}, {1, 2, 4, 7}};
  const int odd = (i + j + k) % 2;
  for (const auto& corners : kFive) {
    mesh::Tet tet;
    for (std::size_t c = 0; c < 4; ++c)
      tet[c] = node_at(i + ((corners[c] & 1) ^ odd), j + (corners[c] >> 1 & 1),
                       k + (corners[c] >> 2 & 1));
    const auto at = [&](std::size_t c) { return mesh.rest_positions[tet[c].value]; };
    if (dot(cross(at(1) - at(0), at(2) - at(0)), at(3) - at(0)) < 0) std::swap(tet[0], tet[1]);
    mesh.tets.push_back(tet);
  }
}

}  // namespace trocar::catalogue
