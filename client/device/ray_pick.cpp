#include "client/device/ray_pick.h"

namespace trocar::device {

std::optional<PickedPlace> pick_place(std::span<const Vec3f> positions, Triangles triangles,
                                      const Vec3f& origin, const Vec3f& direction) {
  std::optional<PickedPlace> nearest;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    // The test is that of Moller and Trumbore 1997, with culling.
    const auto& triangle = triangles[i];
    const Vec3f a = positions[triangle[0]];
    const Vec3f ab = positions[triangle[1]] - a, ac = positions[triangle[2]] - a;
    const Vec3f p = cross(direction, ac);
    const float determinant = dot(ab, p);
    if (determinant <= 0) continue;
    const Vec3f s = origin - a;
    const float u = dot(s, p);
    if (u < 0 || u > determinant) continue;
    const Vec3f q = cross(s, ab);
    const float v = dot(direction, q);
    if (v < 0 || u + v > determinant) continue;
    const float t = dot(ac, q) / determinant;
    if (t > 0 && (!nearest || t < nearest->t))
      nearest = {t, static_cast<std::uint32_t>(i), {u / determinant, v / determinant}};
  }
  return nearest;
}

std::optional<float> pick(std::span<const Vec3f> positions, Triangles triangles,
                          const Vec3f& origin, const Vec3f& direction) {
  const auto place = pick_place(positions, triangles, origin, direction);
  if (!place) return std::nullopt;
  return place->t;
}

}  // namespace trocar::device
