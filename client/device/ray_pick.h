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

// A place on a triangle: weights of its second and third corner.
struct PickedPlace {
  float t = 0;  // origin + t direction is the place
  std::uint32_t triangle = 0;
  std::array<float, 2> weight{};
};

// The first place along the ray, t > 0, on a triangle that faces it (counter-clockwise seen from
// the origin).
std::optional<PickedPlace> pick_place(std::span<const Vec3f> positions, Triangles triangles,
                                      const Vec3f& origin, const Vec3f& direction);
// Only its t.
std::optional<float> pick(std::span<const Vec3f> positions, Triangles triangles,
                          const Vec3f& origin, const Vec3f& direction);

}  // namespace trocar::device
