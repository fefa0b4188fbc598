#pragma once

// Rotations and poses. World frame: right-handed, y up, metres, origin at the centre of the organ's
// rest bounding box. Tool frame: origin at the tip, +z back along the shaft.

#include "common/math/vec3.h"

namespace trocar {

// A unit quaternion has the component order x, y, z, w (also on the wire).
struct Quatf {
  float x = 0, y = 0, z = 0, w = 1;

  constexpr bool operator==(const Quatf&) const = default;
};

float norm(const Quatf& q);
// Divides by the norm; q must not be zero.
Quatf normalized(const Quatf& q);
Quatf conjugate(const Quatf& q);
Quatf operator*(const Quatf& a, const Quatf& b);
Vec3f rotate(const Quatf& q, const Vec3f& v);
// Shortest rotation that takes the +z axis to `direction` (unit length).
Quatf rotation_from_z(const Vec3f& direction);
// Normalised linear interpolation on the shorter arc, t in [0, 1].
Quatf interpolate(const Quatf& a, const Quatf& b, float t);

// world_from_tool: p_world = rotate(orientation, p_tool) + position.
struct Pose {
  Vec3f position;
  Quatf orientation;

  Vec3f apply(const Vec3f& p) const { return rotate(orientation, p) + position; }
  Vec3f apply_inverse(const Vec3f& p) const { return rotate(conjugate(orientation), p - position); }
  constexpr bool operator==(const Pose&) const = default;
};
// Returns the pose at part t of the way from a to b.
inline Pose part_of_way(const Pose& a, const Pose& b, float t) {
  if (t >= 1) return b;
  return {a.position + (b.position - a.position) * t, interpolate(a.orientation, b.orientation, t)};
}

}  // namespace trocar
