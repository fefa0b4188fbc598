#pragma once

// The surface as the hand believes it to be: the newest that the server has told, and how far the
// one before was from it, which fades. m.

#include "common/math/vec3.h"

namespace trocar::haptics {

struct BelievedSurface {
  Vec3d normal{0, 0, 1}, plane_m, grip_point_m;
  double depth_offset_m = 0;  // of the believed surface over the newest one
  Vec3d grip_offset_m;        // likewise

  double depth_of(const Vec3d& core_m, double clearance_m) const {
    return dot(normal, plane_m - core_m) + clearance_m;
  }
  double believed_depth_of(const Vec3d& core_m, double clearance_m) const {
    return depth_of(core_m, clearance_m) + depth_offset_m;
  }
  Vec3d believed_grip_m() const { return grip_point_m + grip_offset_m; }
};

}  // namespace trocar::haptics
