#pragma once

// How well shaped the tets of a mesh are, beyond the worst of them (dihedral_range in tet_mesh.h).

#include <array>
#include <cstddef>

#include "server/organs/mesh/tet_mesh.h"

namespace trocar::mesh {

// How many tets have their smallest dihedral angle in each class of 10 degrees; that of a regular
// tet is 70.5 degrees.
inline constexpr std::size_t kDihedralClasses = 8;
std::array<std::size_t, kDihedralClasses> dihedral_histogram(const TetMesh& mesh);

}  // namespace trocar::mesh
