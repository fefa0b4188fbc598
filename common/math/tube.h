#pragma once

#include <algorithm>

#include "common/math/vec3.h"

namespace trocar {

// The distance of a place from a tube with round ends, negative within; a ball where both ends are
// one place.
inline double distance_from_tube(const Vec3d& place, const Vec3d& from, const Vec3d& to,
                                 double radius) {
  const auto along = to - from;
  const double squared = length_squared(along);
  const double t = squared > 0 ? std::clamp(dot(place - from, along) / squared, 0.0, 1.0) : 0.0;
  return length(place - (from + along * t)) - radius;
}

}  // namespace trocar
