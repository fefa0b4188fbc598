#pragma once

// The solid of a tool: a sphere-swept rectangle, capsule or sphere, all points within its radius of
// a core. The core is a rectangle that holds the shaft's axis, `2 half_width` across (the tool's x)
// and as long as the shaft less both end caps (the tool's z). With half_width = 0 it is a segment
// and the solid a capsule, with a shaft of two radii a point and a sphere; with a small radius the
// solid is a blade with round edges. The tip of the shaft is the tool frame's origin.

#include <algorithm>
#include <array>

#include "common/math/frame.h"
#include "common/tool/tool.h"

namespace trocar::contact {

struct ToolSolid {
  Vec3f begin, across, along;  // of the core, world frame; across and along are unit vectors
  float half_width = 0, length = 0, radius = 0;  // m

  ToolSolid(const Pose& pose, const tool::ToolShape& shape)
      : across(rotate(pose.orientation, {1, 0, 0})),
        along(rotate(pose.orientation, {0, 0, 1})),
        half_width(shape.half_width_m),
        length(std::max(0.0f, shape.length_m - 2 * shape.radius_m)),
        radius(shape.radius_m) {
    begin = pose.position + along * radius;
  }

  Vec3f nearest_on_core(const Vec3f& p) const {
    const Vec3f d = p - begin;
    return begin + across * std::clamp(dot(d, across), -half_width, half_width) +
           along * std::clamp(dot(d, along), 0.0f, length);
  }
  std::array<Vec3f, 4> core_corners() const {
    const Vec3f a = across * half_width, b = along * length;
    return {begin - a, begin + a, begin - a + b, begin + a + b};
  }
};

// The farthest that corners, hence points of a core, are from one another.
inline float greatest_distance(const std::array<Vec3f, 4>& a, const std::array<Vec3f, 4>& b) {
  float most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, length(a[i] - b[i]));
  return most;
}
// How far a motion of the tool takes a point of its core.
inline float way_between(const Pose& a, const Pose& b, const tool::ToolShape& shape) {
  return greatest_distance(ToolSolid(a, shape).core_corners(), ToolSolid(b, shape).core_corners());
}

}  // namespace trocar::contact
