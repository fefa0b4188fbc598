#pragma once

// Corners as they stand in a file, three a triangle, to vertices: one for each place.

#include <vector>

#include "common/math/vec3.h"
#include "server/organs/surface/raw_surface.h"

namespace trocar::formats {

// `corners`: finite, three for each triangle. Triangles and face numbers follow their order;
// vertices that of the first corner at each place.
surface::RawSurface weld(const std::vector<Vec3d>& corners);

}  // namespace trocar::formats
