#pragma once

// Trocar's world beside the patient as 3D Slicer has it.
//
//   world    m    x to the patient's left, y to the head, z to the front; the organ's centre is 0
//   RAS      mm   R to the right, A to the front, S to the head; the scan's own origin
//
//   R = -1000 (x + ox),  A = 1000 (z + oz),  S = 1000 (y + oy)
//
// o is where the organ's centre lies in its scan, in the world's axes; 0 for an organ of no scan.
// A tool's own axes are the same on both sides: its tip is at 0, and +z runs back along the shaft.
// Immutable; any thread.

#include <array>

#include "common/base/result.h"
#include "common/math/frame.h"
#include "common/math/vec3.h"

namespace trocar::slicer {

// RAS from the tool, mm: the first three rows of a transform, as OpenIGTLink carries it.
using Transform = std::array<std::array<float, 4>, 3>;

inline constexpr float kFarthest_mm = 2000;  // of a tracked tool from the organ's centre
inline constexpr float kMostSkew = 0.01f;    // of a rotation's axes, in length and angle

class Frames {
 public:
  Frames() = default;
  explicit Frames(const Vec3d& offset_m) : offset_m_(offset_m) {}

  Vec3f to_ras_mm(const Vec3f& world_m) const;
  // Turns a vector of any unit, such as a force.
  static Vec3f to_ras_axes(const Vec3f& v) { return {-v.x, v.z, v.y}; }
  Transform to_ras(const Pose& world_from_tool) const;
  // Error, without the message's name: BadMessage if a number is not finite; Refused if the axes
  // are no rotation (they scale, shear or mirror, or cannot be inverted), or the place is beyond
  // kFarthest_mm, as a tracker may say that has lost its tool.
  Result<Pose> from_ras(const Transform& ras_from_tool) const;

 private:
  Vec3d offset_m_;
};

}  // namespace trocar::slicer
