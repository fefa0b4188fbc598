#include "server/tissue/cutting/blade_patch.h"

#include <algorithm>
#include <limits>

namespace trocar::cutting {
namespace {

constexpr double kLeastSegment = 1e-6;  // m
constexpr double kLeastSine = 1e-6;     // of the angle between the edges of a triangle
// A blade that turns by more than 165 degrees goes back as it came.
constexpr double kReturnCosine = -0.9659258262890683;
constexpr double kSameDistance = 1 + 1e-9;

Vec3d closest_on_segment(const Vec3d& a, const Vec3d& b, const Vec3d& p) {
  const Vec3d along = b - a;
  const double t = dot(p - a, along) / length_squared(along);
  return a + along * std::clamp(t, 0.0, 1.0);
}

void extend_ends(BladeEdge& edge, double extension) {
  auto &first = edge.points[0], &last = edge.points[edge.count - 1];
  const Vec3d out_of_first = normalized(first - edge.points[1], Vec3d{});
  const Vec3d out_of_last = normalized(last - edge.points[edge.count - 2], Vec3d{});
  first += out_of_first * extension;
  last += out_of_last * extension;
}

// Counter-clockwise seen from the left hand of the motion, with the edge pointing up.
void add_triangle(const Vec3d& a, const Vec3d& b, const Vec3d& c, double return_cosine, Side& side,
                  std::vector<PatchTriangle>& out) {
  auto triangle = make_triangle({a, b, c});
  if (!triangle) return;
  const Vec3d last = side.is_on_other_hand ? -side.normal : side.normal;
  if (dot(triangle->normal, last) < return_cosine) side.is_on_other_hand = !side.is_on_other_hand;
  if (side.is_on_other_hand) triangle = make_triangle({a, c, b});
  if (!triangle) return;
  out.push_back(*triangle);
  side.normal = triangle->normal;
}

}  // namespace

bool is_blade(std::span<const Vec3d> points) {
  if (points.size() < 2 || points.size() > kMaxEdgePoints) return false;
  double total = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!is_finite(points[i]) || !(length_squared(points[i]) < kMaxFromOrigin * kMaxFromOrigin))
      return false;
    if (i == 0) continue;
    const double segment = length(points[i] - points[i - 1]);
    if (!(segment > kLeastSegment)) return false;
    total += segment;
  }
  return total <= kMaxEdgeLength;
}

double longest_motion(const BladeEdge& from, const BladeEdge& to) {
  double longest = 0;
  for (std::uint32_t i = 0; i < from.count; ++i)
    longest = std::max(longest, length_squared(to.points[i] - from.points[i]));
  return std::sqrt(longest);
}

BladeEdge between(const BladeEdge& from, const BladeEdge& to, double t) {
  BladeEdge edge = to;
  for (std::uint32_t i = 0; i < to.count; ++i)
    edge.points[i] = from.points[i] + (to.points[i] - from.points[i]) * t;
  return edge;
}

std::optional<PatchTriangle> make_triangle(const std::array<Vec3d, 3>& corners) {
  const auto& [a, b, c] = corners;
  const Vec3d doubled_area = cross(b - a, c - a);
  const double longest_squared =
      std::max({length_squared(b - a), length_squared(c - b), length_squared(a - c)});
  if (!(length(doubled_area) > kLeastSine * longest_squared)) return std::nullopt;
  PatchTriangle triangle{corners, normalized(doubled_area, Vec3d{}), {}};
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3d edge = corners[(i + 1) % 3] - corners[i];
    triangle.inward[i] = normalized(cross(triangle.normal, edge), Vec3d{});
  }
  return triangle;
}

double signed_distance(const PatchTriangle& triangle, const Vec3d& p) {
  return dot(triangle.normal, p - triangle.corners[0]);
}

bool is_inside(const PatchTriangle& triangle, const Vec3d& p, double slack) {
  for (std::size_t i = 0; i < 3; ++i)
    if (!(dot(triangle.inward[i], p - triangle.corners[i]) >= -slack)) return false;
  return true;
}

double distance_squared(const PatchTriangle& triangle, const Vec3d& p) {
  const double d = signed_distance(triangle, p);
  if (is_inside(triangle, p, 0)) return d * d;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i)
    least =
        std::min(least, length_squared(p - closest_on_segment(triangle.corners[i],
                                                              triangle.corners[(i + 1) % 3], p)));
  return least;
}

void make_patch(const Strip& strip, double extension, double least_turn, Sides& sides,
                std::vector<PatchTriangle>& out) {
  out.clear();
  BladeEdge from = strip.from, to = strip.to;
  const double longest = longest_motion(from, to);
  if (!(longest > 0)) return;
  const double return_cosine = longest < least_turn ? 0 : kReturnCosine;
  for (std::uint32_t i = 0; i < to.count; ++i) {
    const Vec3d ahead = (strip.to.points[i] - strip.from.points[i]) * (extension / longest);
    to.points[i] += ahead;
    if (strip.is_first) from.points[i] = from.points[i] - ahead;
  }
  extend_ends(from, extension);
  extend_ends(to, extension);
  for (std::uint32_t i = 0; i + 1 < to.count; ++i) {
    add_triangle(from.points[i], from.points[i + 1], to.points[i + 1], return_cosine, sides[i],
                 out);
    add_triangle(from.points[i], to.points[i + 1], to.points[i], return_cosine, sides[i], out);
  }
}

std::optional<NearestPart> nearest_part(const Strip& strip,
                                        std::span<const PatchTriangle> triangles,
                                        const Sides& before, const Sides& after, const Vec3d& p) {
  std::optional<NearestPart> nearest;
  for (const auto& triangle : triangles) {
    const double d = distance_squared(triangle, p);
    if (!nearest || d < nearest->distance_squared)
      nearest = {d, signed_distance(triangle, p), false};
  }
  if (!nearest || strip.is_first) return nearest;
  const auto& from = strip.from;
  for (std::uint32_t i = 0; i + 1 < from.count; ++i) {
    const Vec3d away = p - closest_on_segment(from.points[i], from.points[i + 1], p);
    const double d = length_squared(away);
    if (d > nearest->distance_squared * kSameDistance) continue;
    nearest->is_joint = true;
    nearest->height = dot(before[i].normal + after[i].normal, away) / 2;
  }
  return nearest;
}

}  // namespace trocar::cutting
