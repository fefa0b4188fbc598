#pragma once

// Figures of an organ that people are told.

#include "common/math/vec3.h"
#include "server/organs/organ/organ.h"

namespace trocar::organ {

// The volume that the surface encloses, m^3: that of the tets where there are any, and that of a
// lattice too.
double enclosed_volume(const mesh::TetMesh& mesh);
// Returns the size of the rest bounding box, m.
Vec3d size_of(const mesh::TetMesh& mesh);
double mass_kg(const Organ& organ);

}  // namespace trocar::organ
