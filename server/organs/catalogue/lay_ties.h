#pragma once

// Ties from one body's surface to another's, evenly over the area of the first that faces the
// second and is near it.

#include <vector>

#include "server/organs/organ/tie.h"

namespace trocar::catalogue {

// Each triangle of the first is parted into small equal triangles, of at most area_m2 each; a tie
// begins in the middle of one, and ends at the nearest place of the second. It is left out where
// that is farther than within_m, or where the surface looks elsewhere. The nodes of either body
// are ascending.
std::vector<organ::Tie> lay_ties(const mesh::TetMesh& mesh, const std::vector<NodeIndex>& first,
                                 const std::vector<NodeIndex>& second, double within_m,
                                 double area_m2);

}  // namespace trocar::catalogue
