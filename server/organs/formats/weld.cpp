#include "server/organs/formats/weld.h"

#include <algorithm>
#include <array>
#include <numeric>

namespace trocar::formats {

surface::RawSurface weld(const std::vector<Vec3d>& corners) {
  std::vector<std::uint32_t> order(corners.size());
  std::iota(order.begin(), order.end(), std::uint32_t{0});
  const auto key = [&](std::uint32_t i) {
    return std::array{corners[i].x, corners[i].y, corners[i].z};
  };
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const auto ka = key(a), kb = key(b);
    return ka != kb ? ka < kb : a < b;
  });
  // The first corner at each place, then vertices in the order of the file.
  std::vector<std::uint32_t> first(corners.size()), vertex(corners.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && corners[order[i]] == corners[order[i - 1]];
    first[order[i]] = same ? first[order[i - 1]] : order[i];
  }
  surface::RawSurface surface;
  for (std::uint32_t i = 0; i < corners.size(); ++i)
    if (first[i] == i) {
      vertex[i] = static_cast<std::uint32_t>(surface.positions.size());
      surface.positions.push_back(corners[i]);
    }
  for (std::size_t t = 0; t < corners.size() / 3; ++t) {
    const auto node = [&](std::size_t i) { return NodeIndex(vertex[first[3 * t + i]]); };
    surface.triangles.push_back({node(0), node(1), node(2)});
    surface.face_numbers.push_back(static_cast<std::int64_t>(t) + 1);
  }
  return surface;
}

}  // namespace trocar::formats
