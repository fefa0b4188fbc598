#pragma once

// Instruments and arrows as triangles, in the tool frame (tip at the origin, +z back along the
// shaft).

#include <array>
#include <cstdint>
#include <vector>

#include "common/math/vec3.h"
#include "common/tool/tool.h"

namespace trocar::shape {

struct Colour {
  std::uint8_t r = 255, g = 255, b = 255;
};
// Sixteen well-separated colours, one per participant slot with tools.
Colour colour_of_slot(int slot);
// Bright ones that no hand has, for who points.
Colour colour_of_pointer(int slot);
// One per merged region, different from each other for neighbours in number.
Colour colour_of_region(int region);

struct MeshVertex {
  Vec3f position, normal;
  std::array<std::uint8_t, 4> material;  // rgb, and 0 plastic to 255 steel
};
using MeshVertices = std::vector<MeshVertex>;  // three per triangle, counter-clockwise outside

// Steel shaft with a collar and a band in `colour`, from behind the jaws to its end.
MeshVertices make_shaft(const tool::ToolShape& shape, Colour colour);
// One of two jaws, the half of a round-nosed capsule above y = 0. Closed, two of them have the
// outline that the simulation uses. The hinge is at z = jaw_length().
MeshVertices make_jaw(const tool::ToolShape& shape);
float jaw_length(const tool::ToolShape& shape);
// A flat tool: the solid that the simulation uses (half width across x, round edges), then a grip
// in `colour`.
MeshVertices make_blade(const tool::ToolShape& shape, Colour colour);
// A thread along +z that ends, `length` on, in a small ball: from a tool to the hand that moves it.
MeshVertices make_ghost(float length, Colour colour);
// Along +z from the origin, `length` long including its head.
MeshVertices make_arrow(float length, float radius, Colour colour);

}  // namespace trocar::shape
