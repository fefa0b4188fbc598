#pragma once

// Triangles as a file gives them, before anything is known about them.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/math/vec3.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::surface {

// Axes of a patient: towards which sides x, y and z run.
enum class Axes {
  Unsaid,
  Ras,  // right, front (anterior), head (superior)
  Lps,  // left, back (posterior), head
  LeftHeadFront
};

struct RawSurface {
  std::vector<Vec3d> positions;           // in the file's unit
  std::vector<mesh::Triangle> triangles;  // valid indices into `positions`
  // The file's number of the face of each triangle, from 1: a face of more corners is several.
  std::vector<std::int64_t> face_numbers;
  // Each triangle's corners are here in a picture, u to the right and v upward, 0 to 1; empty: the
  // file does not say it.
  std::vector<std::array<std::array<double, 2>, 3>> corner_texture;
  // A PNG or JPEG file that the file itself holds for them; empty: it has none.
  std::string picture;
  Axes axes = Axes::Unsaid;      // that the file says of itself
  std::optional<double> unit_m;  // likewise; nothing: it does not say it
  // One line with file and line: the file says it wrongly, and corner_texture is empty.
  std::string texture_fault;
  std::vector<std::string> left_out;  // one line each: what of the file is not here
};

}  // namespace trocar::surface
