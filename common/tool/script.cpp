#include "common/tool/script.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"

namespace trocar::tool {
namespace {

// Distance along the ray o + t d to the triangle, or nothing (Moeller and Trumbore 1997, in double,
// without culling). `weights` are the barycentric coordinates of the hit.
std::optional<double> intersect(const Vec3d& d, const std::array<Vec3d, 3>& corner,
                                Vec3d& weights) {
  const Vec3d ab = corner[1] - corner[0];
  const Vec3d ac = corner[2] - corner[0];
  const Vec3d p = cross(d, ac);
  const double determinant = dot(ab, p);
  if (std::abs(determinant) < 1e-18) return std::nullopt;
  const Vec3d from_a = -corner[0];  // the ray starts at the origin
  const double u = dot(from_a, p) / determinant;
  const Vec3d q = cross(from_a, ab);
  const double v = dot(d, q) / determinant;
  // A hair of tolerance, so that a ray through an edge does not slip between its two triangles.
  constexpr double kSlack = 1e-9;
  if (u < -kSlack || v < -kSlack || u + v > 1 + kSlack) return std::nullopt;
  const double t = dot(ac, q) / determinant;
  if (t < 0) return std::nullopt;
  weights = {1 - u - v, u, v};
  return t;
}

Vec3d area_normal(const std::array<Vec3d, 3>& corner) {
  return cross(corner[1] - corner[0], corner[2] - corner[0]);
}

AnchorPoint with_axes(const Vec3d& position, const Vec3d& normal) {
  const Vec3d z = normalized(normal, Vec3d{0, 0, 1});
  const Vec3d up{0, 1, 0};
  Vec3d x = cross(up, z);
  // Within 3 degrees of the vertical the horizontal direction is noise.
  if (length(x) < 0.05) x = Vec3d{1, 0, 0} - z * z.x;
  x = normalized(x, Vec3d{1, 0, 0});
  return {to_float(position), to_float(x), to_float(cross(z, x)), to_float(z)};
}

Vec3f to_world(const AnchorPoint& anchor, AnchorFrame frame, const Vec3f& v) {
  if (frame == AnchorFrame::World) return v;
  return anchor.axis_x * v.x + anchor.axis_y * v.y + anchor.axis_z * v.z;
}

Pose pose_of(const ScriptTool& tool, const ScriptKey& key, const AnchorPoint& anchor) {
  if (!tool.anchor) return {key.position_m, rotation_from_z(key.shaft)};
  const AnchorFrame frame = tool.anchor->frame;
  const Vec3f shaft = to_world(anchor, frame, key.shaft);
  return {anchor.position + to_world(anchor, frame, key.position_m),
          rotation_from_z(normalized(shaft, Vec3f{0, 0, 1}))};
}

}  // namespace

Result<AnchorPoint> find_anchor(const ScriptAnchor& anchor, std::span<const Vec3f> rest_positions,
                                std::span<const SurfaceTriangle> triangles) {
  if (triangles.empty() || rest_positions.empty())
    return Error{ErrorCode::BadMessage, "anchor: the organ has no surface, use one with triangles"};
  const Vec3d d = to_double(anchor.direction);
  std::vector<Vec3d> normals(rest_positions.size());
  std::optional<double> farthest;
  const SurfaceTriangle* hit = nullptr;
  Vec3d hit_weights;
  for (const auto& triangle : triangles) {
    std::array<Vec3d, 3> corner;
    for (int i = 0; i < 3; ++i) {
      if (triangle[i] >= rest_positions.size())
        return Error{ErrorCode::BadMessage,
                     "anchor: a triangle names vertex " + std::to_string(triangle[i]) + " of " +
                         std::to_string(rest_positions.size()) + ", use an organ that validates"};
      corner[i] = to_double(rest_positions[triangle[i]]);
    }
    const Vec3d normal = area_normal(corner);
    for (const auto vertex : triangle) normals[vertex] += normal;
    Vec3d weights;
    const auto t = anchor.on == AnchorOn::Ray ? intersect(d, corner, weights) : std::nullopt;
    if (t && (!farthest || *t > *farthest)) {
      farthest = t;
      hit = &triangle;
      hit_weights = weights;
    }
  }
  if (hit != nullptr) {
    const Vec3d normal = normalized(normals[(*hit)[0]], Vec3d{}) * hit_weights.x +
                         normalized(normals[(*hit)[1]], Vec3d{}) * hit_weights.y +
                         normalized(normals[(*hit)[2]], Vec3d{}) * hit_weights.z;
    return with_axes(d * *farthest, normal);
  }
  std::size_t best = triangles[0][0];
  for (const auto& triangle : triangles)
    for (const auto vertex : triangle) {
      const double here = dot(to_double(rest_positions[vertex]), d);
      const double there = dot(to_double(rest_positions[best]), d);
      if (here > there || (here == there && vertex < best)) best = vertex;
    }
  return with_axes(to_double(rest_positions[best]), normals[best]);
}

ToolSample sample(const ScriptTool& tool, double seconds, const AnchorPoint& anchor) {
  TROCAR_ASSERT(!tool.keys.empty());
  const auto& keys = tool.keys;
  if (tool.loops && seconds >= keys.back().time_s) seconds = std::fmod(seconds, keys.back().time_s);
  const auto after =
      std::upper_bound(keys.begin(), keys.end(), seconds,
                       [](double t, const ScriptKey& key) { return t < key.time_s; });
  if (after == keys.begin()) return {pose_of(tool, keys.front(), anchor), keys.front().verb};
  const ScriptKey& from = *(after - 1);
  const Pose start = pose_of(tool, from, anchor);
  if (after == keys.end()) return {start, from.verb};

  const Pose end = pose_of(tool, *after, anchor);
  const double linear = (seconds - from.time_s) / (after->time_s - from.time_s);
  const float t =
      static_cast<float>(tool.ease == Ease::Smooth ? linear * linear * (3 - 2 * linear) : linear);
  return {{start.position + (end.position - start.position) * t,
           interpolate(start.orientation, end.orientation, t)},
          from.verb};
}

}  // namespace trocar::tool
