#pragma once

// Bodies of revolution and their materials, for this folder's own .cpp files.

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include "client/shape/tool_mesh.h"

namespace trocar::shape {

using Material = std::array<std::uint8_t, 4>;
inline constexpr Material kSteel = {196, 201, 208, 255};
inline constexpr Material kDarkSteel = {120, 124, 132, 255};
inline constexpr Material kGrip = {44, 48, 55, 30};
inline constexpr float kPi = std::numbers::pi_v<float>;

inline Material plastic(Colour c) {
  return {c.r, c.g, c.b, 0};
}

struct ProfilePoint {
  float z, radius;
  Material material;       // of the band that ends here
  bool is_smooth = false;  // share the normal with the band before
};

// Sweeps a profile (z descending towards the tip or ascending, either way outward is away from the
// axis) around +z over an arc.
inline void revolve(std::span<const ProfilePoint> profile, int segments, float from, float to,
                    MeshVertices& out) {
  const auto slope = [&](std::size_t band) {  // outward normal of a band in (radius, z)
    const float dz = profile[band].z - profile[band - 1].z;
    const float dr = profile[band].radius - profile[band - 1].radius;
    const float l = std::max(std::sqrt(dz * dz + dr * dr), 1e-9f);
    return std::array<float, 2>{dz / l, -dr / l};
  };
  for (std::size_t band = 1; band < profile.size(); ++band) {
    auto first = slope(band), last = first;
    const auto blend = [&](std::array<float, 2>& a, const std::array<float, 2>& b) {
      const float x = a[0] + b[0], y = a[1] + b[1], l = std::max(std::sqrt(x * x + y * y), 1e-9f);
      a = {x / l, y / l};
    };
    if (band > 1 && profile[band - 1].is_smooth) blend(first, slope(band - 1));
    if (band + 1 < profile.size() && profile[band].is_smooth) blend(last, slope(band + 1));
    const auto vertex = [&](std::size_t point, float angle, const std::array<float, 2>& n) {
      const float c = std::cos(angle), s = std::sin(angle), r = profile[point].radius;
      return MeshVertex{
          {r * c, r * s, profile[point].z}, {n[0] * c, n[0] * s, n[1]}, profile[band].material};
    };
    for (int i = 0; i < segments; ++i) {
      const float step = (to - from) / static_cast<float>(segments);
      const float a = from + step * static_cast<float>(i), b = a + step;
      const auto p = vertex(band - 1, a, first), q = vertex(band - 1, b, first);
      const auto r = vertex(band, b, last), s = vertex(band, a, last);
      out.insert(out.end(), {p, q, r, p, r, s});
    }
  }
}

}  // namespace trocar::shape
