#pragma once

// This stands between a computed force and a hand, in one place and in this order:
//
//   1 a force, torque or place that is no number: 0 at once
//   2 a reading of the device older than 20 ms, or one that jumped: 0 at once
//   3 no answer of the server for 250 ms in contact: falls with 250 ms; comes back within 250 ms
//   4 ramp: grows from 0 within 250 ms, at the start and after each of 1 and 2
//   5 passivity: what was done to the hand beyond what tissue may have stored is damped away
//   6 slew: at most 0.3 N/ms (measured: a tap at 400 mm/s needs 0.17, a grasp 0.20)
//   7 the device's own limit
//
// 1 and 2 have the last word: they undo whatever the others say. All in the device's frame, at the
// hand. No step allocates; one thread.

#include <array>
#include <cstdint>

#include "client/device/haptic_device.h"
#include "common/math/vec3.h"

namespace trocar::haptics {

enum class Limit : std::uint8_t {
  NotFinite,
  StaleReading,
  Jump,
  OldPatch,
  Ramp,
  Passivity,
  Slew,
  Device
};
inline constexpr std::size_t kLimits = 8;
const char* name_of(Limit limit);

struct SafetySettings {
  double stale_reading_s = 0.020;
  double jump_m = 0.050;  // between two steps: no hand does that, a broken reading does
  double patch_age_s = 0.250, patch_fall_s = 0.250;
  double ramp_s = 0.250;
  double slew_n_s = 300, torque_slew_nm_s = 9;  // torque: that force at a lever of 30 mm
  double most_damping_n_s_m = 6;
};

struct SafetyInput {
  Vec3d force_n, torque_nm;
  Vec3d position_m;
  double stiffness_n_m = 0;  // of what touches
  double reading_age_s = 0;
  double patch_age_s = 0;  // since the newest arrived
  bool touches = false;
  double dt_s = 0.001;
};

struct SafeForce {
  Vec3d force_n, torque_nm;
  std::uint32_t limits = 0;  // bit by Limit: those that changed it
};

class Safety {
 public:
  explicit Safety(const device::DeviceLimits& device, const SafetySettings& settings = {})
      : device_(device), settings_(settings) {}

  SafeForce step(const SafetyInput& input);

  using Counts = std::array<std::uint64_t, kLimits>;
  const Counts& counts() const { return counts_; }  // steps that each changed
  // Done on the hand beyond what it did, J.
  double work_j() const { return work_j_; }

 private:
  bool must_stop(const SafetyInput& input, SafeForce& safe);
  void note(Limit limit, SafeForce& safe);
  void observe(const SafetyInput& input);
  Vec3d damped(const Vec3d& force_n, const SafetyInput& input, SafeForce& safe);

  device::DeviceLimits device_;
  SafetySettings settings_;
  Counts counts_{};
  Vec3d last_force_n_, last_torque_nm_, last_position_m_, velocity_m_s_;
  bool has_position_ = false;
  double ramp_ = 0;   // 0 to 1
  double trust_ = 1;  // in the newest answer, likewise
  double work_j_ = 0;
};

}  // namespace trocar::haptics
