#pragma once

// Tetrahedra fill the solid of a label map, and each label gets a region.
//
// The surface of the mesh follows the solid's, and faces of tets the interfaces between labels
// (mesh/conform.h). Interfaces are then moved by a small part of the spacing, so that each label
// has its volume (mesh/match_volumes.h). A label that is thinner than the mesh is given whole tets
// for it (thin_labels.h), and warnings say how much of it is at its place, and in how many pieces.
// A region is of tets, and not of all whose nodes it has.

#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/organs/label_map/label_solid.h"
#include "server/organs/mesh/raw_tets.h"

namespace trocar::label_map {

// Spacings by which a node of an interface moves at most for the labels' volumes.
inline constexpr double kMaxInterfaceShift = 0.15;

struct LabelMesh {
  mesh::ImportedMesh imported;     // centred; regions are there if the solid has two labels or more
  std::vector<std::string> notes;  // one line each: how well it fits
};

// names: of some labels. Error: as fill_field() has it, begun with `name`.
Result<LabelMesh> mesh_labels(const LabelSolid& solid, int nodes,
                              const std::vector<std::pair<std::uint16_t, std::string>>& names,
                              const std::string& name);

}  // namespace trocar::label_map
