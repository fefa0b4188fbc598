#pragma once

// Moves interfaces between labels along their normals until labels have the volumes that are asked
// for.
//
// Flat faces between nodes on a bent interface cut it short: a ball of tets has less volume than
// the ball its nodes are on. As the outer surface is grown for that (fill_field.h), interfaces are
// moved by a constant for each label.

#include <cstdint>
#include <utility>
#include <vector>

#include "server/organs/mesh/tet_mesh.h"
#include "server/organs/mesh/tet_stars.h"

namespace trocar::mesh {

// volumes: label and m^3, in the order in which they are met; that of the label left out follows.
// No node moves more than limit_m from where it was, nodes of the outer surface move along it, and
// no tet leaves the bound. Where that keeps a volume from being met, it stays as near as it got.
void match_volumes(TetMesh& mesh, const std::vector<std::uint16_t>& tet_labels,
                   const std::vector<std::pair<std::uint16_t, double>>& volumes, double limit_m,
                   const ShapeBound& bound);

// Triangles between tets of that label and tets of others, facing outward.
std::vector<Triangle> interface_of(const TetMesh& mesh,
                                   const std::vector<std::uint16_t>& tet_labels,
                                   std::uint16_t label);

}  // namespace trocar::mesh
