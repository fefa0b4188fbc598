#pragma once

// An axis-aligned box; empty until something is in it.

#include <algorithm>
#include <limits>

#include "common/math/vec3.h"

namespace trocar {

template <typename T>
struct Box {
  // Finite, so that slack may be added.
  static constexpr T kFar = std::numeric_limits<T>::max();
  Vec3<T> least{kFar, kFar, kFar}, most{-kFar, -kFar, -kFar};

  void include(const Vec3<T>& p) {
    least = {std::min(least.x, p.x), std::min(least.y, p.y), std::min(least.z, p.z)};
    most = {std::max(most.x, p.x), std::max(most.y, p.y), std::max(most.z, p.z)};
  }
  void grow(T by) {
    least -= Vec3<T>{by, by, by};
    most += Vec3<T>{by, by, by};
  }
  bool contains(const Vec3<T>& p) const {
    return p.x >= least.x && p.y >= least.y && p.z >= least.z && p.x <= most.x && p.y <= most.y &&
           p.z <= most.z;
  }
  // Or are no farther apart than the slack along each axis.
  bool overlaps(const Box& b, T slack = 0) const {
    return least.x <= b.most.x + slack && b.least.x <= most.x + slack &&
           least.y <= b.most.y + slack && b.least.y <= most.y + slack &&
           least.z <= b.most.z + slack && b.least.z <= most.z + slack;
  }
};

}  // namespace trocar
