#include "common/lesson/loose_piece.h"

#include <limits>
#include <numeric>

namespace trocar::lesson {

Components::Components(const wire::SurfaceLayout& layout)
    : parent_(layout.vertex_count()), is_held_(layout.vertex_count()) {
  std::iota(parent_.begin(), parent_.end(), 0u);
  for (const auto& corners : layout.triangles) {
    if (!corners[0].is_valid()) continue;
    join(corners[0].value, corners[1].value);
    join(corners[0].value, corners[2].value);
  }
  for (const auto vertex : layout.fixed_vertices) is_held_[of(vertex.value)] = 1;
}

std::uint32_t Components::of(std::uint32_t vertex) {
  while (parent_[vertex] != vertex) vertex = parent_[vertex] = parent_[parent_[vertex]];
  return vertex;
}

std::vector<TriangleIndex> find_loose_piece(const wire::SurfaceLayout& layout,
                                            const Vec3d& place_m) {
  Components components(layout);
  double nearest = std::numeric_limits<double>::max();
  std::optional<std::uint32_t> wanted;
  for (std::uint32_t t = 0; t < layout.triangles.size(); ++t) {
    if (!layout.has_triangle(TriangleIndex(t))) continue;
    const auto component = components.of(layout.triangles[t][0].value);
    if (components.is_held(component)) continue;
    for (const auto corner : layout.triangles[t])
      if (const double d = length_squared(layout.rest_m(corner) - place_m); d < nearest)
        nearest = d, wanted = component;
  }
  std::vector<TriangleIndex> piece;
  for (std::uint32_t t = 0; t < layout.triangles.size(); ++t)
    if (layout.has_triangle(TriangleIndex(t)) &&
        components.of(layout.triangles[t][0].value) == wanted)
      piece.emplace_back(t);
  return piece;
}

PlacedPiece place_piece(const wire::SurfaceLayout& layout,
                        std::span<const wire::QuantisedVertex> displacements,
                        std::span<const TriangleIndex> piece) {
  PlacedPiece placed;
  double area = 0;
  for (const auto number : piece) {
    const auto first = placed.corners.size();
    for (const auto corner : layout.triangles[number.value]) {
      auto place = layout.rest_m(corner);
      if (corner.value < displacements.size())
        place += to_double(wire::to_metres(displacements[corner.value]));
      placed.corners.push_back(place);
    }
    const auto &a = placed.corners[first], &b = placed.corners[first + 1],
               &c = placed.corners[first + 2];
    const double weight = length(cross(b - a, c - a)) / 2;
    placed.centre_m += (a + b + c) / 3 * weight;
    area += weight;
  }
  if (area > 0) placed.centre_m = placed.centre_m / area;
  return placed;
}

}  // namespace trocar::lesson
