#pragma once

// Pieces of a set of tets: which hang together, and clean-up of raw sets before build_adjacency().
// All functions read and write `rest_positions` and `tets` only; derived lists are stale
// afterwards. Complexity O(n log n), deterministic.

#include <vector>

#include "server/organs/mesh/tet_mesh.h"

namespace trocar::mesh {

// Per tet the number of its piece; pieces are numbered in order of their first tet. Tets hang
// together over whole faces: a shared node or edge alone would be a hinge.
struct Pieces {
  std::vector<std::uint32_t> piece_of_tet;
  std::uint32_t count = 0;
};
Pieces find_pieces(const TetMesh& mesh);

// Keeps the piece of largest volume (the first of equals). Returns how many others were dropped.
std::uint32_t keep_largest_piece(TetMesh& mesh);

// The surface would not be manifold where the tets around an edge form several fans that touch
// along that edge only: keeps the fan of largest volume, drops the others, until there is no such
// edge. Returns how many tets were dropped.
std::size_t drop_touching_parts(TetMesh& mesh);

// Drops nodes that no tet uses, keeping the order of the rest. Returns how many.
std::size_t drop_unused_nodes(TetMesh& mesh);

// Drops unused nodes and renumbers the rest in order of (z, y, x), tets by their smallest node, so
// that neighbours lie close in memory whatever made the mesh. Returns for each node the number that
// it had among the used ones.
std::vector<std::uint32_t> renumber_along_z(TetMesh& mesh);

}  // namespace trocar::mesh
