#include "common/lesson/wound.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "common/lesson/loose_piece.h"

namespace trocar::lesson {
namespace {

constexpr double kCellM = 0.002;

struct Triangle {
  std::array<Vec3d, 3> corner;
  Vec3d centroid() const { return (corner[0] + corner[1] + corner[2]) / 3; }
  double area() const { return length(cross(corner[1] - corner[0], corner[2] - corner[0])) / 2; }
};

Triangle triangle_of(const wire::SurfaceLayout& layout, const wire::Corners& corners) {
  return {{layout.rest_m(corners[0]), layout.rest_m(corners[1]), layout.rest_m(corners[2])}};
}

template <typename Visit>
void for_each_wound(const wire::SurfaceLayout& layout, Visit visit) {
  for (std::uint32_t t = 0; t < layout.triangles.size(); ++t)
    if (layout.is_wound[t] != 0 && layout.has_triangle(TriangleIndex(t)))
      visit(triangle_of(layout, layout.triangles[t]));
}

// Says where a place lies beside a line: how far along, how far aside, how deep.
struct Beside {
  double along_m = 0, aside_m = 0, depth_m = 0;
};

Beside beside(std::span<const Vec3d> line, const Vec3d& place) {
  Beside best;
  double nearest = std::numeric_limits<double>::max(), way = 0;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const auto along = line[i + 1] - line[i];
    const double span = length(along);
    if (!(span > 0)) continue;
    const auto tangent = along / span;
    const double u = std::clamp(dot(place - line[i], tangent), 0.0, span);
    const auto foot = line[i] + tangent * u;
    // Deep is towards the centre, but never along the line.
    const auto inward = normalized(-foot + tangent * dot(foot, tangent), Vec3d{0, -1, 0});
    const auto offset = place - foot;
    const double depth = dot(offset, inward);
    const double aside = length(offset - inward * depth);
    if (aside < nearest) {
      nearest = aside;
      best = {way + u, aside, depth};
    }
    way += span;
  }
  return best;
}

// The solid angle that a closed surface fills seen from a place: 4 pi within, 0 outside (van
// Oosterom and Strackee 1983).
double solid_angle(const Triangle& triangle, const Vec3d& place) {
  const auto a = triangle.corner[0] - place, b = triangle.corner[1] - place,
             c = triangle.corner[2] - place;
  const double la = length(a), lb = length(b), lc = length(c);
  const double below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
  return 2 * std::atan2(dot(a, cross(b, c)), below);
}

}  // namespace

Incision measure_incision(const wire::SurfaceLayout& layout, std::span<const Vec3d> line_m,
                          double depth_m, double tolerance_m) {
  Incision result;
  double way = 0, area = 0;
  for (std::size_t i = 0; i + 1 < line_m.size(); ++i) way += length(line_m[i + 1] - line_m[i]);
  const auto cells = std::max<std::size_t>(1, static_cast<std::size_t>(way / kCellM));
  std::vector<std::uint8_t> is_deep(cells);
  const double cell_m = way / static_cast<double>(cells);
  const auto cell_of = [&](double along) {
    return std::min(cells - 1, static_cast<std::size_t>(along / cell_m));
  };
  for_each_wound(layout, [&](const Triangle& triangle) {
    const auto middle = beside(line_m, triangle.centroid());
    if (middle.aside_m > tolerance_m) {
      result.stray_m2 += triangle.area();
      return;
    }
    area += triangle.area();
    result.error_m += middle.aside_m * triangle.area();
    // A triangle covers the cells between its corners.
    double first = way, last = 0, deepest = middle.depth_m;
    for (const auto& corner : triangle.corner) {
      const auto place = beside(line_m, corner);
      first = std::min(first, place.along_m), last = std::max(last, place.along_m);
      deepest = std::max(deepest, place.depth_m);
    }
    if (deepest >= depth_m)
      for (auto cell = cell_of(first); cell <= cell_of(last); ++cell) is_deep[cell] = 1;
  });
  if (area > 0) result.error_m /= area;
  result.covered = static_cast<double>(std::ranges::count(is_deep, 1)) / static_cast<double>(cells);
  return result;
}

std::optional<Specimen> find_specimen(const wire::SurfaceLayout& layout,
                                      const Structure& structure) {
  Components components(layout);
  const auto centre = (structure.from_m + structure.to_m) / 2;
  std::vector<double> angle(layout.vertex_count());
  const auto for_each_free = [&](auto visit) {
    for (std::uint32_t t = 0; t < layout.triangles.size(); ++t) {
      if (!layout.has_triangle(TriangleIndex(t))) continue;
      const auto component = components.of(layout.triangles[t][0].value);
      if (!components.is_held(component)) visit(t, component);
    }
  };
  for_each_free([&](std::uint32_t t, std::uint32_t component) {
    angle[component] += solid_angle(triangle_of(layout, layout.triangles[t]), centre);
  });
  const auto found = std::ranges::find_if(angle, [](double a) { return a > 2 * std::numbers::pi; });
  if (found == angle.end()) return std::nullopt;
  const auto wanted = static_cast<std::uint32_t>(found - angle.begin());
  Specimen specimen{.volume_m3 = 0, .margin_m = std::numeric_limits<double>::max()};
  for_each_free([&](std::uint32_t t, std::uint32_t component) {
    if (component != wanted) return;
    const auto triangle = triangle_of(layout, layout.triangles[t]);
    specimen.volume_m3 +=
        dot(triangle.corner[0], cross(triangle.corner[1], triangle.corner[2])) / 6;
    if (layout.is_wound[t] == 0) return;
    for (const auto& corner : triangle.corner)
      specimen.margin_m = std::min(specimen.margin_m, structure.distance_m(corner));
  });
  return specimen;
}

double wound_within_m2(const wire::SurfaceLayout& layout, const Structure& structure) {
  double area = 0;
  for_each_wound(layout, [&](const Triangle& triangle) {
    if (structure.distance_m(triangle.centroid()) < 0) area += triangle.area();
  });
  return area;
}

}  // namespace trocar::lesson
