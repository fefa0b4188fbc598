#pragma once

// Boxes and balls of triangles, outward, for tests of surfaces.

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "server/organs/surface/raw_surface.h"

namespace trocar::surface::testing {

inline void add_triangle(RawSurface& surface, std::array<std::size_t, 3> corners) {
  surface.triangles.push_back(
      {NodeIndex(corners[0]), NodeIndex(corners[1]), NodeIndex(corners[2])});
  surface.face_numbers.push_back(static_cast<std::int64_t>(surface.triangles.size()));
}

// With sides of `size` from `low` on; mirrored: facing inward.
inline void add_box(RawSurface& surface, const Vec3d& low, double size, bool is_mirrored = false) {
  const auto first = surface.positions.size();
  for (int i = 0; i < 8; ++i)
    surface.positions.push_back(low + Vec3d{size * (i & 1), size * (i >> 1 & 1), size * (i >> 2)});
  static constexpr std::size_t kFaces[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6},
                                                {0, 1, 5}, {0, 5, 4}, {2, 6, 7}, {2, 7, 3},
                                                {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  for (const auto& [a, b, c] : kFaces)
    add_triangle(surface,
                 {first + a, first + (is_mirrored ? c : b), first + (is_mirrored ? b : c)});
}

// A ball around the origin: an octahedron whose triangles are split `splits` times.
inline RawSurface ball(double radius, int splits) {
  RawSurface surface;
  surface.positions = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  std::vector<std::array<std::size_t, 3>> faces = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                                   {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int s = 0; s < splits; ++s) {
    std::map<std::pair<std::size_t, std::size_t>, std::size_t> middles;
    const auto middle = [&](std::size_t a, std::size_t b) {
      const auto [at, is_new] = middles.try_emplace(std::minmax(a, b), surface.positions.size());
      if (is_new) {
        const Vec3d sum = surface.positions[a] + surface.positions[b];
        surface.positions.push_back(sum / length(sum));
      }
      return at->second;
    };
    std::vector<std::array<std::size_t, 3>> finer;
    for (const auto& [a, b, c] : faces) {
      const auto ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    faces = std::move(finer);
  }
  for (Vec3d& p : surface.positions) p *= radius;
  for (const auto& face : faces) add_triangle(surface, face);
  return surface;
}

}  // namespace trocar::surface::testing
