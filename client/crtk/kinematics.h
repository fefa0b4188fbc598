#pragma once

// The joints of an arm whose shaft passes a remote centre, and the pose of its tip. An arm's base
// frame has its origin at the remote centre, the port in the body's wall, and +z out of the body.
//
//   yaw, pitch   of the shaft about the remote centre        rad
//   insertion    of the shaft along itself                   m
//   roll         of the shaft about itself                   rad
//   wrist_pitch, wrist_yaw   of an instrument with a wrist   rad
//
// Axes, offsets and signs are those of the da Vinci Research Kit's PSM with a large needle driver:
// with all joints at zero the tip points to -z. An arm without a wrist, the ECM, has the first four
// joints and a straight shaft. The tip's frame has its origin at the tip, and +z out of the jaws.

#include <array>
#include <span>
#include <string>

#include "common/math/frame.h"

namespace trocar::crtk {

inline constexpr std::size_t kMostJoints = 6;
inline constexpr float kWristToTip_m = 0.0193f;  // of an instrument with a wrist, stretched
using Joints = std::array<double, kMostJoints>;

struct Kinematics {
  bool has_wrist = true;

  std::size_t joint_count() const { return has_wrist ? 6 : 4; }
  // Returns how ROS names them.
  std::span<const char* const> joint_names() const;

  Pose tip_at(const Joints& joints) const;

  struct Reach {
    Joints joints{};
    Pose tip;           // where these joints have it
    std::string limit;  // what keeps the tip from where it should be; empty: nothing does
  };
  // The joints within their limits whose tip is at `tip`, or as near as they come: the place has
  // precedence over the direction. `before`: of several turns, those nearest to it are taken.
  Reach reach(const Pose& tip, const Joints& before) const;

  // Returns the joints of a tip, whatever their limits are.
  Joints joints_of(const Pose& tip, const Joints& before) const;
  Joints within_limits(Joints joints) const;
};

// Angle between two orientations, rad.
double angle_between(const Quatf& a, const Quatf& b);

}  // namespace trocar::crtk
