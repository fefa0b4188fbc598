#pragma once

// Fills a solid, given as a signed distance, with about as many nodes as asked for, so that the
// mesh has the solid's volume.
//
// Stuffing cuts corners off where the surface bends: a mesh of flat faces between nodes on a convex
// surface lies inside it. The isosurface is therefore moved outward by a constant, a part of the
// spacing, until the volumes agree; the constant and the spacing are found together. Same numbers,
// same mesh.

#include "common/base/result.h"
#include "server/organs/mesh/stuffing.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::mesh {

inline constexpr int kMinFillNodes = 100, kMaxFillNodes = 100'000;
inline constexpr double kFillVolumeTolerance = 0.01;  // share of the volume

struct FilledSolid {
  TetMesh mesh;
  double spacing_m = 0;  // of the lattice
  double grown_m = 0;    // by which the isosurface was moved outward
};

// distance: negative inside, m, near the surface at least. volume_m3 and surface_m2: of the solid.
// Error: no lattice has about `nodes` nodes, or the volume cannot be met within 1 %: parts are
// thinner than the spacing. nodes must be within the two constants.
Result<FilledSolid> fill_field(const SignedField& distance, const Box& box, double volume_m3,
                               double surface_m2, int nodes);

}  // namespace trocar::mesh
