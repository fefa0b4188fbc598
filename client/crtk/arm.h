#pragma once

// One arm: what servo commands make of its setpoint, its state, and what it measures. It knows no
// DDS, no network and no clock of its own.
//
//   servo_cp --checks--> joints within limits --> setpoint --> ToolSample
//   servo_cf --checks--> force --measure: moves with (force + that of the tissue) / damping--^
//   jaw/servo_jp --checks--> jaw angle --> verb
//
// Outside data: what is no number, in another frame, too far from the setpoint or not allowed in
// this state changes nothing, and an error says why. A stream that ends leaves the arm where it is.
// A force moves the arm from frame to frame, in simulated time, as the tissue does. Thread: one.

#include <cstdint>
#include <optional>
#include <string>

#include "client/crtk/operating_state.h"
#include "client/crtk/servo.h"
#include "client/replica/session_view.h"
#include "common/base/result.h"
#include "common/tool/tool.h"

namespace trocar::crtk {

struct ArmSettings {
  std::string name;  // PSM1
  Kinematics kinematics;
  bool has_jaw = true;
  Vec3d port_m;                              // the remote centre, world frame
  tool::Verb grip_verb = tool::Verb::Grasp;  // what closed jaws do
  std::string frame() const { return name + "_base"; }
};

class Arm {
 public:
  static constexpr double kMostJump_m = 0.03, kMostJump_rad = 0.8;  // from one servo_cp to the next
  static constexpr double kMostSpeed_m_s = 1, kMostSpeed_rad_s = 6;
  static constexpr double kMostForce_n = 10;
  static constexpr double kDamping_n_s_m = 40, kMostForceSpeed_m_s = 0.05;  // of servo_cf
  static constexpr std::uint64_t kStaleNs = 100'000'000;  // a servo_cf without a next one ends
  static constexpr double kClosed_rad = 0.05, kOpen_rad = 0.15;

  explicit Arm(ArmSettings settings);

  // Each may tell something in notice(), too, where it is followed in part.
  Status take(const ServoPose& servo, std::uint64_t now_ns);
  Status take(const ServoWrench& servo, std::uint64_t now_ns);
  Status take(const ServoJaw& servo);
  Status follow(std::string_view command);
  // Homes, if it has to, and ends what is stale. Call it at least every 10 ms.
  void step(std::uint64_t now_ns);

  // Says what is wrong with the arm; empty: nothing is. It becomes a FAULT.
  void set_fault(std::string fault);
  // Why the session keeps the tool where it is; empty: it does not.
  void set_hold(std::string hold) { hold_ = std::move(hold); }
  // Returns what a person should know since the last call; nothing: no more.
  std::optional<std::string> pop_notice() { return std::exchange(notice_, std::nullopt); }

  // Returns what the server should be told now.
  tool::ToolSample sample() const;
  // Reads the tool as a new frame of the session has it.
  Measured measure(const replica::Tool& tool, Tick tick);

  const ArmSettings& settings() const { return settings_; }
  const OperatingState& state() const { return state_; }
  const Pose& setpoint() const { return setpoint_; }

 private:
  Status check_motion(const char* topic, const std::string& frame) const;
  Status move_to(const Pose& tip, double dt_s);
  void home(double dt_s);
  void press(double dt_s);
  void note_limit(const std::string& limit);
  void set_joints(const Joints& joints);

  const ArmSettings settings_;
  const Pose world_from_base_;
  OperatingState state_;
  Joints joints_{};
  Pose setpoint_, asked_;  // of the tip; what was asked for, and what of it can be
  double jaw_rad_ = 0.5;
  bool is_closed_ = false;
  std::uint64_t servo_ns_ = 0, step_ns_ = 0;
  std::optional<Vec3f> force_n_;  // of servo_cf
  Vec3f tissue_n_;                // measured last
  std::string fault_, hold_, limit_;
  std::optional<std::string> notice_;
  std::optional<Measured> measured_;
  Tick measured_tick_ = 0;
};

}  // namespace trocar::crtk
