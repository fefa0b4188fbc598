#pragma once

// An arm is told this by CRTK, and measures this, as plain values: nothing above the bus sees DDS.
// Metres, newtons, radians, seconds; in the arm's base frame unless it says otherwise.

#include <array>
#include <string>
#include <vector>

#include "client/crtk/kinematics.h"

namespace trocar::crtk {

// servo_cp: where the tip should be. Outside data, as it came.
struct ServoPose {
  std::string frame;  // of the header
  std::array<double, 3> position_m{};
  std::array<double, 4> orientation{0, 0, 0, 1};  // x, y, z, w

  bool operator==(const ServoPose&) const = default;
};

// servo_cf: with what the arm should press. Likewise.
struct ServoWrench {
  std::string frame;
  std::array<double, 3> force_n{}, torque_nm{};

  bool operator==(const ServoWrench&) const = default;
};

// jaw/servo_jp: how far the jaws should be open. Likewise.
struct ServoJaw {
  std::vector<double> position_rad;

  bool operator==(const ServoJaw&) const = default;
};

// This is what an arm measures, from one frame of the session.
struct Measured {
  Pose tip;
  Vec3f velocity_m_s, turning_rad_s;
  Vec3f force_n, torque_nm;  // of the tissue on the tool, torque about the tip
  Joints joints{}, joint_speeds{};
  double jaw_rad = 0, jaw_speed_rad_s = 0;
};

}  // namespace trocar::crtk
