#pragma once

// ROS 2's messages as Fast CDR writes and reads them, member by member from their public
// definitions.

#include <array>
#include <string>
#include <vector>

#include "tests/crtk/fast_peer.h"

namespace trocar::crtk {

inline constexpr const char* kPoseType = "geometry_msgs::msg::dds_::PoseStamped_";
inline constexpr const char* kTwistType = "geometry_msgs::msg::dds_::TwistStamped_";
inline constexpr const char* kWrenchType = "geometry_msgs::msg::dds_::WrenchStamped_";
inline constexpr const char* kJointType = "sensor_msgs::msg::dds_::JointState_";
inline constexpr const char* kStateType = "crtk_msgs::msg::dds_::OperatingState_";
inline constexpr const char* kCommandType = "crtk_msgs::msg::dds_::StringStamped_";
inline constexpr const char* kTextType = "std_msgs::msg::dds_::String_";

struct PoseSample {
  std::string frame;
  std::array<double, 3> position{};
  std::array<double, 4> orientation{0, 0, 0, 1};
};
struct WrenchSample {
  std::string frame;
  std::array<double, 3> force{}, torque{};
};
struct JointSample {
  std::vector<std::string> name;
  std::vector<double> position, velocity, effort;
};
struct StateSample {
  std::string state;
  bool is_homed = false, is_busy = false;
};

Sample write(const PoseSample& sample);
Sample write(const WrenchSample& sample);
Sample write(const JointSample& sample);
Sample write_command(const std::string& command);

// No bytes give a sample as it is at first.
PoseSample read_pose(const Sample& bytes);
WrenchSample read_wrench(const Sample& bytes);
JointSample read_joints(const Sample& bytes);
StateSample read_state(const Sample& bytes);
std::string read_text(const Sample& bytes);

}  // namespace trocar::crtk
