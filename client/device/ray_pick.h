#pragma once

// Finds where a ray first meets a triangle surface. The time is linear in the number of triangles:
// a few thousand triangles cost some tens of microseconds, once per display frame.

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/math/vec3.h"

namespace trocar::device {

using Triangles = std::span<const std::array<std::uint32_t, 3>>;

// Smallest t > 0 with origin + t direction on a triangle that faces the ray (counter-clockwise seen
// from the origin).
std::optional<float> pick(std::span<const Vec3f> positions, Triangles triangles,
                          const Vec3f& origin, const Vec3f& direction);

}  // namespace trocar::device
