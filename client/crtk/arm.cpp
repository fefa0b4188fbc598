#include "client/crtk/arm.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/base/printable.h"

namespace trocar::crtk {
namespace {

constexpr Joints kHome{0, 0, 0.08, 0, 0, 0};
constexpr double kHomingTurn_rad_s = 0.5, kHomingSlide_m_s = 0.05;
constexpr double kLeastJaw_rad = -0.35, kMostJaw_rad = 1.4;
constexpr double kMostFrame_s = 0.05;  // of simulated time, for which a force moves the arm
constexpr double kUnitSlack = 0.01;    // of a quaternion's length
constexpr Quatf kHalfTurn{1, 0, 0,
                          0};  // the engine's tools have +z along the shaft, out of the body

Error refused(const char* topic, const std::string& why) {
  return {ErrorCode::Refused, std::string(topic) + ": " + why};
}

template <std::size_t N>
bool are_finite(const std::array<double, N>& values) {
  return std::ranges::all_of(values, [](double v) { return std::isfinite(v); });
}

Vec3f vector_of(const std::array<double, 3>& v) {
  return to_float({v[0], v[1], v[2]});
}

Pose base_at(const Vec3d& port_m) {
  return {to_float(port_m), rotation_from_z(to_float(normalized(port_m, Vec3d{0, 0, 1})))};
}

double seconds_between(std::uint64_t begin_ns, std::uint64_t end_ns, double most) {
  if (begin_ns == 0 || end_ns <= begin_ns) return 0;
  return std::min(most, static_cast<double>(end_ns - begin_ns) * 1e-9);
}

}  // namespace

Arm::Arm(ArmSettings settings)
    : settings_(std::move(settings)), world_from_base_(base_at(settings_.port_m)) {
  set_joints(kHome);
}

void Arm::set_joints(const Joints& joints) {
  joints_ = joints;
  setpoint_ = asked_ = settings_.kinematics.tip_at(joints);
}

Status Arm::check_motion(const char* topic, const std::string& frame) const {
  if (!frame.empty() && frame != settings_.frame())
    return refused(topic, "its frame_id is '" + printable(frame, 40) + "'; write " +
                              settings_.frame() + ", or nothing");
  if (!hold_.empty()) return refused(topic, hold_);
  if (state_.can_move()) return {};
  const std::string word = name_of(state_.state);
  if (state_.state != State::Enabled) return refused(topic, "the arm is " + word + "; enable it");
  return refused(topic, state_.is_busy ? "the arm is busy homing" : "the arm is not homed");
}

Status Arm::take(const ServoPose& servo, std::uint64_t now_ns) {
  constexpr const char* kTopic = "servo_cp";
  if (!are_finite(servo.position_m) || !are_finite(servo.orientation))
    return refused(kTopic, "holds what is no number");
  double square = 0;
  for (const double part : servo.orientation) square += part * part;
  if (!(std::abs(std::sqrt(square) - 1) <= kUnitSlack))
    return refused(
        kTopic, fmt::format("its quaternion has length {:.3g}, not 1 to 1 %", std::sqrt(square)));
  if (const auto may = check_motion(kTopic, servo.frame); !may) return may;
  const auto& q = servo.orientation;
  const Pose tip{vector_of(servo.position_m),
                 normalized(Quatf{static_cast<float>(q[0]), static_cast<float>(q[1]),
                                  static_cast<float>(q[2]), static_cast<float>(q[3])})};
  const double dt_s = seconds_between(servo_ns_, now_ns, 1);
  if (auto moved = move_to(tip, dt_s); !moved) return moved;
  servo_ns_ = now_ns;
  force_n_.reset();
  return {};
}

// A little more than the speed allows, as samples come unevenly.
Status Arm::move_to(const Pose& tip, double dt_s) {
  const auto reached = settings_.kinematics.reach(tip, joints_);
  const double far_m = std::max(length(tip.position - asked_.position),
                                length(reached.tip.position - setpoint_.position));
  const double far_rad = std::max(angle_between(tip.orientation, asked_.orientation),
                                  angle_between(reached.tip.orientation, setpoint_.orientation));
  const double most_m = std::min(kMostJump_m, 0.005 + kMostSpeed_m_s * dt_s);
  const double most_rad = std::min(kMostJump_rad, 0.1 + kMostSpeed_rad_s * dt_s);
  if (!(far_m <= most_m && far_rad <= most_rad))
    return refused(
        "servo_cp",
        fmt::format("jumps by {:.3g} mm and {:.3g} degrees, and may by {:.3g} and {:.3g} "
                    "now; begin at measured_cp",
                    far_m * 1e3, far_rad * 57.2958, most_m * 1e3, most_rad * 57.2958));
  joints_ = reached.joints;
  setpoint_ = reached.tip;
  asked_ = tip;
  note_limit(reached.limit);
  return {};
}

void Arm::note_limit(const std::string& limit) {
  if (limit != limit_ && !limit.empty())
    notice_ = "servo: the tip cannot be there, it stays where the limit of " + limit + " is";
  limit_ = limit;
}

Status Arm::take(const ServoWrench& servo, std::uint64_t now_ns) {
  constexpr const char* kTopic = "servo_cf";
  if (!are_finite(servo.force_n) || !are_finite(servo.torque_nm))
    return refused(kTopic, "holds what is no number");
  const Vec3f force = vector_of(servo.force_n);
  if (!(length(force) <= kMostForce_n))
    return refused(kTopic, fmt::format("asks for {:.3g} N, at most {:.3g} N may be", length(force),
                                       kMostForce_n));
  if (length(vector_of(servo.torque_nm)) > 0)
    return refused(kTopic, "asks for a torque, which no arm here follows; send zero");
  if (const auto may = check_motion(kTopic, servo.frame); !may) return may;
  force_n_ = force;
  servo_ns_ = now_ns;
  return {};
}

Status Arm::take(const ServoJaw& servo) {
  constexpr const char* kTopic = "jaw/servo_jp";
  if (servo.position_rad.size() != 1 || !std::isfinite(servo.position_rad.front()))
    return refused(kTopic, "position has to be one number, the angle of the jaws in rad");
  if (const auto may = check_motion(kTopic, ""); !may) return may;
  jaw_rad_ = std::clamp(servo.position_rad.front(), kLeastJaw_rad, kMostJaw_rad);
  is_closed_ = jaw_rad_ <= (is_closed_ ? kOpen_rad : kClosed_rad);
  return {};
}

Status Arm::follow(std::string_view command) {
  const auto before = state_;
  auto followed = state_.follow(command, fault_);
  if (state_ == before) return followed;
  force_n_.reset();
  asked_ = setpoint_;
  return followed;
}

void Arm::set_fault(std::string fault) {
  if (fault == fault_) return;
  fault_ = std::move(fault);
  force_n_.reset();
  if (fault_.empty()) return;
  if (state_.state != State::Disabled) state_.fail();
  notice_ = fault_;
}

void Arm::step(std::uint64_t now_ns) {
  const double dt_s = seconds_between(step_ns_, now_ns, 0.01);
  step_ns_ = now_ns;
  if (state_.is_busy && state_.state == State::Enabled && hold_.empty()) home(dt_s);
  if (force_n_ && now_ns - servo_ns_ > kStaleNs) {
    force_n_.reset();
    notice_ = "servo_cf: the stream has ended, the arm stays where it is";
  }
}

void Arm::home(double dt_s) {
  Joints next = joints_;
  for (std::size_t i = 0; i < kMostJoints; ++i) {
    const double most = dt_s * (i == 2 ? kHomingSlide_m_s : kHomingTurn_rad_s);
    const double left = kHome[i] - next[i];
    next[i] = std::abs(left) <= most ? kHome[i] : next[i] + std::copysign(most, left);
  }
  set_joints(next);
  if (next == kHome) state_.finish_homing();
}

void Arm::press(double dt_s) {
  Vec3f speed = (*force_n_ + tissue_n_) / static_cast<float>(kDamping_n_s_m);
  const float most = static_cast<float>(kMostForceSpeed_m_s), fast = length(speed);
  if (fast > most) speed *= most / fast;
  const Pose tip{setpoint_.position + speed * static_cast<float>(dt_s), setpoint_.orientation};
  const auto reached = settings_.kinematics.reach(tip, joints_);
  set_joints(reached.joints);
  note_limit(reached.limit);
}

tool::ToolSample Arm::sample() const {
  return {{world_from_base_.apply(setpoint_.position),
           normalized(world_from_base_.orientation * setpoint_.orientation * kHalfTurn)},
          is_closed_ ? settings_.grip_verb : tool::Verb::Push};
}

Measured Arm::measure(const replica::Tool& tool, Tick tick) {
  const Quatf base_from_world = conjugate(world_from_base_.orientation);
  Measured now;
  now.tip.position = world_from_base_.apply_inverse(tool.world_from_proxy.position);
  now.tip.orientation = normalized(base_from_world * tool.world_from_proxy.orientation * kHalfTurn);
  now.force_n = tissue_n_ = rotate(base_from_world, tool.force_n);
  now.torque_nm = rotate(base_from_world, tool.torque_nm);
  now.joints = settings_.kinematics.joints_of(now.tip, measured_ ? measured_->joints : joints_);
  now.jaw_rad = jaw_rad_;
  if (measured_ && tick > measured_tick_) {
    const auto dt_s = static_cast<double>(tick - measured_tick_) * kTickSeconds;
    const float rate = static_cast<float>(1 / dt_s);
    now.velocity_m_s = (now.tip.position - measured_->tip.position) * rate;
    Quatf turn = now.tip.orientation * conjugate(measured_->tip.orientation);
    if (turn.w < 0) turn = {-turn.x, -turn.y, -turn.z, -turn.w};
    now.turning_rad_s = Vec3f{turn.x, turn.y, turn.z} * (2 * rate);  // small between two frames
    for (std::size_t i = 0; i < kMostJoints; ++i)
      now.joint_speeds[i] = (now.joints[i] - measured_->joints[i]) / dt_s;
    now.jaw_speed_rad_s = (now.jaw_rad - measured_->jaw_rad) / dt_s;
    if (force_n_ && state_.can_move() && hold_.empty()) press(std::min(dt_s, kMostFrame_s));
  }
  measured_ = now;
  measured_tick_ = tick;
  return now;
}

}  // namespace trocar::crtk
