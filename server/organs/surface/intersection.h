#pragma once

// Whether triangles of a surface pass through or touch one another where they should not.
//
// Signs of volumes and areas are taken in double precision where that is certain, else in 113 bits:
// exact for coordinates of single precision that are alike in size, and of the last digit for
// others. Triangles that share a corner may touch there, and those that share an edge along it.

#include <span>
#include <utility>
#include <vector>

#include "common/math/vec3.h"
#include "server/organs/mesh/tet_mesh.h"
#include "server/organs/surface/triangle_tree.h"

namespace trocar::surface {

bool intersect(std::span<const Vec3d> positions, const mesh::Triangle& a, const mesh::Triangle& b);

// Pairs of triangles, ascending.
std::vector<std::pair<std::size_t, std::size_t>> intersecting_pairs(
    std::span<const Vec3d> positions, std::span<const mesh::Triangle> triangles,
    const TriangleTree& tree);

}  // namespace trocar::surface
