#pragma once

// Triangles as a file gives them, before anything is known about them.

#include <cstdint>
#include <vector>

#include "common/math/vec3.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::surface {

struct RawSurface {
  std::vector<Vec3d> positions;           // in the file's unit
  std::vector<mesh::Triangle> triangles;  // valid indices into `positions`
  // The file's number of the face of each triangle, from 1: a face of more corners is several.
  std::vector<std::int64_t> face_numbers;
};

}  // namespace trocar::surface
