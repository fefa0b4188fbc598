#pragma once

// Makes faces of tets lie on the interfaces between labels.
//
// Each node has the label at its place. Edges in whose middle another label is, as in a thin
// vessel, are split there. An edge whose ends have different labels crosses an interface. Nodes
// that have a crossing close to them are moved onto it, as isosurface stuffing does; then the edges
// that still cross are split there, the short ones first. A node on an interface has the labels of
// both its sides. Where three labels meet, an edge from a node on an interface of two to a node of
// the third is split where the third begins, and the new node has all three: lines at which three
// meet are within a cell of their place, and not on it.
//
// Every change is refused that would leave a tet outside the bounds of dihedral angles of stuffing.
// Then the interface has a step there, and is counted. Nodes of the outer surface move along it
// only, so that it stays what it was. Features thinner than the distance of neighbouring nodes may
// be lost.
//
// Source: Labelle, Shewchuk: Isosurface stuffing, SIGGRAPH 2007, for the moves; the split of one
// edge after the other replaces its stencils.

#include <cstdint>
#include <functional>
#include <vector>

#include "common/base/result.h"
#include "server/organs/mesh/stuffing.h"
#include "server/organs/mesh/tet_mesh.h"
#include "server/organs/mesh/tet_stars.h"

namespace trocar::mesh {

using LabelAt = std::function<std::uint16_t(const Vec3d&)>;  // of a place, m

// Every change keeps the dihedral angles of stuffing: 12 to 156 degrees.
ShapeBound conforming_bound();

struct ConformingMesh {
  TetMesh mesh;                           // adjacency built, valid
  std::vector<std::uint16_t> tet_labels;  // of each tet
  std::size_t moved_nodes = 0, split_edges = 0;
  std::size_t steps = 0;  // tets through which an interface still passes
};

// mesh: one of stuff_isosurface() with that spacing. surface: of the same solid, zero on the mesh's
// outer surface, about the distance from it, m. Error: the result is not valid. The same inputs
// give the same mesh.
Result<ConformingMesh> conform_to_labels(const TetMesh& mesh, double spacing_m,
                                         const LabelAt& label_at, const SignedField& surface);

}  // namespace trocar::mesh
