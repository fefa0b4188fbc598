#pragma once

// Consistent nodal forces of an even traction on a part of the surface: areas at rest, dead loads.
// A linear face gives a third of its force to each corner, a quadratic one to each middle node.

#include <span>

#include "server/lab/finite_elements/problem.h"

namespace trocar::finite_elements {

// Per node of the elements, its share of the area of the boundary triangles whose three corners are
// selected, m^2. `is_selected`: per corner node. The elements are made from the mesh.
std::vector<double> area_shares(const mesh::TetMesh& mesh, const ElementMesh& elements,
                                std::span<const std::uint8_t> is_selected);
// The same times the outward normal: for pressures.
std::vector<Vec3d> normal_area_shares(const mesh::TetMesh& mesh, const ElementMesh& elements,
                                      std::span<const std::uint8_t> is_selected);

}  // namespace trocar::finite_elements
