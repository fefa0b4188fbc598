#pragma once

// Tetrahedra fill the solid of a label map, and each label gets a region.
//
// The surface of the mesh follows the solid's; interfaces between labels run along faces of tets,
// each of which takes the label of most of its volume. They are as coarse as the mesh.

#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/organs/label_map/label_solid.h"
#include "server/organs/mesh/raw_tets.h"

namespace trocar::label_map {

struct LabelMesh {
  mesh::ImportedMesh imported;     // centred; regions are there if the solid has two labels or more
  std::vector<std::string> notes;  // one line each: how well it fits
};

// names: of some labels. Error: as fill_field() has it, begun with `name`.
Result<LabelMesh> mesh_labels(const LabelSolid& solid, int nodes,
                              const std::vector<std::pair<std::uint16_t, std::string>>& names,
                              const std::string& name);

}  // namespace trocar::label_map
