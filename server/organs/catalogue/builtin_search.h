#pragma once

// Finds the lattice spacing that gives a built-in organ its number of tets.

#include <functional>
#include <string>

#include "common/base/result.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::catalogue {

// Meshes at a spacing in metres; fails where the spacing is too large for the shape.
using MeshAtSpacing = std::function<Result<mesh::TetMesh>(double)>;

// The mesh whose number of tets comes nearest to the target, at most 5 % from it. The first guess
// is the spacing with spacing^3 = 12 volume / target; a volume somewhat above the organ's own,
// which allows for the smaller tets at the surface, saves attempts. `name` starts the error.
Result<mesh::TetMesh> mesh_with_about(int target_tets, double volume_m3,
                                      const MeshAtSpacing& mesh_at, const std::string& name);

}  // namespace trocar::catalogue
