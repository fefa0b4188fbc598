#include "client/replica/drawn_lines.h"

#include <algorithm>
#include <limits>

namespace trocar::replica {
namespace {

// Weights of the second and third corner of the point of a triangle that is nearest to p (Ericson
// 2005, section 5.1.5).
std::array<float, 2> nearest_weights(const Vec3f& p, const Vec3f& a, const Vec3f& b,
                                     const Vec3f& c) {
  const Vec3f ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const float d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return {0, 0};
  const float d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return {1, 0};
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return {d1 / (d1 - d3), 0};
  const float d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return {0, 1};
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return {0, d2 / (d2 - d6)};
  const float va = d3 * d6 - d5 * d4;
  const float along = d4 - d3, back = d5 - d6;
  if (va <= 0 && along >= 0 && back >= 0 && along + back > 0)
    return {back / (along + back), along / (along + back)};
  const float sum = va + vb + vc;
  if (!(sum > 0)) return {0, 0};
  return {vb / sum, vc / sum};
}

bool is_there(const Topology& topology, std::uint32_t triangle) {
  const auto& corners = topology.triangles[triangle];
  return corners[0] != corners[1];
}

}  // namespace

Attachment attach(const Vec3f& place, const Topology& topology, std::span<const Vec3f> positions,
                  bool in_wound) {
  Attachment best{.triangle = kNoTriangle, .distance_m = std::numeric_limits<float>::max()};
  for (std::uint32_t i = 0; i < topology.triangles.size(); ++i) {
    if (!is_there(topology, i) || (topology.is_wound[i] != 0) != in_wound) continue;
    const auto& corners = topology.triangles[i];
    const Vec3f &a = positions[corners[0]], &b = positions[corners[1]], &c = positions[corners[2]];
    // The box around a triangle tells of most that they are too far.
    const auto gap = [](float p, float x, float y, float z) {
      const float below = std::min({x, y, z}) - p, above = p - std::max({x, y, z});
      return std::max({below, above, 0.0f});
    };
    if (gap(place.x, a.x, b.x, c.x) > best.distance_m ||
        gap(place.y, a.y, b.y, c.y) > best.distance_m ||
        gap(place.z, a.z, b.z, c.z) > best.distance_m)
      continue;
    const auto weight = nearest_weights(place, a, b, c);
    const Vec3f nearest = a + (b - a) * weight[0] + (c - a) * weight[1];
    const float distance = length(nearest - place);
    if (distance < best.distance_m) best = {i, weight, distance};
  }
  return best;
}

void DrawnLines::attach_points(const Replica& replica) {
  const auto& topology = replica.topology();
  const auto& strokes = replica.told().strokes();
  if (drawing_version_ != replica.told().drawing_version() ||
      history_version_ != replica.history_version())
    attached_.clear();
  const bool is_cut = topology_version_ != replica.topology_version();
  drawing_version_ = replica.told().drawing_version();
  history_version_ = replica.history_version();
  topology_version_ = replica.topology_version();
  for (std::size_t i = 0; is_cut && i < attached_.size(); ++i)
    for (std::size_t k = 0; k < attached_[i].size(); ++k) {
      auto& point = attached_[i][k];
      const bool is_gone = point.triangle == kNoTriangle || !is_there(topology, point.triangle);
      if (is_gone) point = attach(strokes[i].rest_m[k], topology, topology.rest_positions);
    }
  for (std::size_t i = attached_.size(); i < strokes.size(); ++i) {
    auto& points = attached_.emplace_back();
    for (const auto& place : strokes[i].rest_m)
      points.push_back(attach(place, topology, topology.rest_positions));
  }
}

void DrawnLines::update(const Replica& replica, std::span<const Vec3f> positions) {
  lines_.clear();
  const auto& topology = replica.topology();
  if (positions.size() != topology.rest_positions.size()) return;
  attach_points(replica);
  for (std::size_t i = 0; i < attached_.size(); ++i) {
    auto& line = lines_.emplace_back();
    line.participant = replica.told().strokes()[i].participant;
    for (const auto& point : attached_[i]) {
      auto& shown = line.points.emplace_back();
      if (point.triangle == kNoTriangle || point.distance_m > kLostMetres) continue;
      const auto& corners = topology.triangles[point.triangle];
      const Vec3f a = positions[corners[0]];
      const Vec3f ab = positions[corners[1]] - a, ac = positions[corners[2]] - a;
      shown.position = a + ab * point.weight[0] + ac * point.weight[1];
      shown.normal = normalized(cross(ab, ac), Vec3f{});
    }
  }
}

}  // namespace trocar::replica
