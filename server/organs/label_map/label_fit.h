#pragma once

// How well a mesh has the labels of a map.

#include <cstdint>
#include <vector>

#include "server/organs/label_map/label_solid.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::label_map {

struct LabelFit {
  std::uint16_t label = 0;
  double mesh_m3 = 0, map_m3 = 0;
  double kept = 0;  // share of the label's voxels whose centre lies in a tet of that label
  // Bodies that hang together over faces and have 1 % of the label's volume or more.
  std::size_t mesh_pieces = 0, map_pieces = 0;
  double thickness_m = 0;  // of the map's: four times volume over surface, the diameter of a tube
};

// One per label of the solid, in their order. mesh: in the map's frame; tet_labels: of each tet.
std::vector<LabelFit> fit_of_labels(const LabelSolid& solid, const mesh::TetMesh& mesh,
                                    const std::vector<std::uint16_t>& tet_labels);

}  // namespace trocar::label_map
