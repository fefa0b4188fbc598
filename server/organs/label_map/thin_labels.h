#pragma once

// Gives labels that are thinner than the mesh as much of it as they have in the map.
//
// A label's demand at a tet is its volume there. Tets that belong to it pay for what they have
// beyond their own demand at the tets around them, which share a node with them. Then the tet with
// the greatest demand for its size is taken from the label that has it, and pays likewise, until
// what is left is less than half a tet: so a thin vessel gets tets all along it, and not all of
// them at one end. It may come out in pieces, but has its volume within a tet.

#include <cstdint>
#include <vector>

#include "server/organs/label_map/label_solid.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::label_map {

inline constexpr double kMissedVolume = 0.05;  // share of a label's from which on it is short

// labels: that may be short of volume, the smallest first; tets are taken from labels behind it and
// from those that are not there. mesh: in the map's frame, with adjacency. Returns whether any tet
// changed hands.
bool fill_thin_labels(const LabelSolid& solid, const mesh::TetMesh& mesh,
                      const std::vector<std::uint16_t>& labels,
                      std::vector<std::uint16_t>& tet_labels);

}  // namespace trocar::label_map
