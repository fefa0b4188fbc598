#pragma once

// Surfaces of boxes at rest, whose volumes and distances are known in closed form.

#include <algorithm>
#include <cmath>

#include "common/wire/surface_layout.h"

namespace trocar::lesson {

inline wire::QuantisedVertex quanta_of(const Vec3d& place_m) {
  const auto q = [](double x) { return static_cast<std::int32_t>(std::lround(x / 32e-6)); };
  return {q(place_m.x), q(place_m.y), q(place_m.z)};
}

// Adds a closed box that shares no vertex with what is there. Its faces at z = hi.z are wound if
// asked for; its vertices at y = lo.y are fixed if asked for.
inline void add_box(wire::SurfaceLayout& layout, const Vec3d& lo, const Vec3d& hi, bool has_wound,
                    bool is_fixed) {
  const auto first = static_cast<std::uint32_t>(layout.rest_quanta.size());
  for (int corner = 0; corner < 8; ++corner) {
    layout.rest_quanta.push_back(
        quanta_of({(corner & 1) != 0 ? hi.x : lo.x, (corner & 2) != 0 ? hi.y : lo.y,
                   (corner & 4) != 0 ? hi.z : lo.z}));
    if (is_fixed && (corner & 2) == 0)
      layout.fixed_vertices.emplace_back(first + static_cast<std::uint32_t>(corner));
  }
  constexpr int kFaces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (int face = 0; face < 6; ++face)
    for (int half = 0; half < 2; ++half) {
      const auto at = [&](int i) {
        return VertexIndex(first + static_cast<std::uint32_t>(kFaces[face][i]));
      };
      layout.triangles.push_back({at(0), at(1 + half), at(2 + half)});
      layout.is_wound.push_back(has_wound && face == 5);
    }
}

// Adds one wound triangle.
inline void add_wound(wire::SurfaceLayout& layout, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const auto first = static_cast<std::uint32_t>(layout.rest_quanta.size());
  for (const auto& place : {a, b, c}) layout.rest_quanta.push_back(quanta_of(place));
  layout.triangles.push_back({VertexIndex(first), VertexIndex(first + 1), VertexIndex(first + 2)});
  layout.is_wound.push_back(1);
}

}  // namespace trocar::lesson
