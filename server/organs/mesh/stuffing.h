#pragma once

// Isosurface stuffing: fills the inside of a surface, given as a signed field, with tetrahedra of
// good shape whatever the surface is.
//
// The field is sampled on a body-centred cubic lattice (cube corners and cube centres). Where the
// surface crosses a lattice edge there is a cut point; a lattice point with a cut point too close
// to it is moved onto the surface; then every lattice tet that is partly inside is replaced by a
// stencil of one to three tets. Faces between neighbours match, because the diagonal of a cut face
// is chosen by a rule that reads that face alone.
//
// Inputs: field(p) in any unit, negative inside, zero on the surface, continuous; a box in metres
// that holds the whole solid; the lattice's cube edge in metres. Edges of the inner tets are 0.87
// and 1 times the spacing, about 2 nodes and 12 tets per cube. Features thinner than the spacing
// may be lost. Output: adjacency built, validate() holds, one piece (of several the one of largest
// volume is kept; where pieces touch along an edge only, the lesser part at that edge is dropped).
// Dihedral angles were within the two constants below in every case measured; stated as a bound
// that tests hold, not proved. Deterministic: the same field values give the same mesh on any
// machine.
//
// Source: Labelle, Shewchuk: Isosurface stuffing, SIGGRAPH 2007 (uniform lattice).

#include <functional>

#include "common/base/result.h"
#include "common/math/box.h"
#include "common/math/vec3.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::mesh {

using SignedField = std::function<double(const Vec3d&)>;

inline constexpr double kStuffingMinDihedral_deg = 12;
inline constexpr double kStuffingMaxDihedral_deg = 156;

using Box = trocar::Box<double>;  // m

Result<TetMesh> stuff_isosurface(const SignedField& field, const Box& box, double spacing_m);

}  // namespace trocar::mesh
