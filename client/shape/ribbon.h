#pragma once

// A line on a surface as triangles: a flat band of one colour that lies on it, with a dark border.

#include <span>

#include "client/shape/tool_mesh.h"

namespace trocar::shape {

struct RibbonPoint {
  Vec3f position;  // m
  Vec3f normal;    // of the surface, of unit length; zero: the line has a gap here
};

// Appends to `out`, in the frame of the points. Neighbours farther apart than 30 mm are not joined:
// tissue has parted between them. A point without a neighbour is a dot.
void add_ribbon(std::span<const RibbonPoint> points, float half_width, Colour colour,
                MeshVertices& out);

}  // namespace trocar::shape
