#include "common/math/frame.h"

#include <cmath>

namespace trocar {

float norm(const Quatf& q) {
  return std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
}

Quatf normalized(const Quatf& q) {
  const float n = norm(q);
  return {q.x / n, q.y / n, q.z / n, q.w / n};
}

Quatf conjugate(const Quatf& q) {
  return {-q.x, -q.y, -q.z, q.w};
}

Quatf operator*(const Quatf& a, const Quatf& b) {
  return {
      a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
      a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z};
}

Vec3f rotate(const Quatf& q, const Vec3f& v) {
  const Vec3f u{q.x, q.y, q.z};
  const Vec3f t = cross(u, v) * 2.0f;
  return v + t * q.w + cross(u, t);
}

Quatf rotation_from_z(const Vec3f& direction) {
  // Half-way quaternion between z and direction: (z x d, 1 + z . d), then normalised.
  if (direction.z < -0.999999f) return {1, 0, 0, 0};
  return normalized(Quatf{-direction.y, direction.x, 0.0f, 1.0f + direction.z});
}

Quatf interpolate(const Quatf& a, const Quatf& b, float t) {
  const float d = a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
  const float s = d < 0 ? -t : t;
  const float r = 1 - t;
  return normalized(
      Quatf{r * a.x + s * b.x, r * a.y + s * b.y, r * a.z + s * b.z, r * a.w + s * b.w});
}

}  // namespace trocar
