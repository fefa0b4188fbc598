#pragma once

// A device without hardware, and the hand on it: a mass on the spring and the damper of an arm that
// follows an intention, with a reflex that answers late. The force written acts on the mass, so
// that loops are closed as with a person. A hand that goes in by a depth may first look for the
// tissue: it goes in slowly until something holds it back, and counts its depth from there.
//
//   m a = k (wanted - x) - b v + k_r (wanted - x) 60 ms ago + F
//
// Steps of 1 ms are counted from the clock's first value: the same clock values and forces give the
// same readings. Each reading costs some 10 flops for each 0.1 ms since the one before. A jump of
// the clock by more than a second puts the hand where it wants to be.

#include <array>
#include <functional>

#include "client/device/hand_script.h"
#include "client/device/haptic_device.h"

namespace trocar::device {

// Values of an arm that holds a stylus loosely.
struct HandModel {
  double mass_kg = 0.15;
  double stiffness_n_m = 400, damping_n_s_m = 4.5;
  double reflex_n_m = 80;
  double encoder_m = 20e-6;  // Positions are rounded to it, as the device's encoders do.
  double search_m_s = 0;     // It looks for the tissue at this speed; 0: it does not.
};

class SimulatedDevice final : public HapticDevice {
 public:
  // Microseconds; must not be empty. A value smaller than the one before counts as the same.
  using ClockUs = std::function<std::uint64_t()>;

  SimulatedDevice(HandScript script, ClockUs clock_us, HandModel model = {});

  Result<DeviceReading> read() override;
  Status write(const Vec3d& force_n, const Vec3d& torque_nm) override;
  DeviceLimits limits() const override;
  std::string description() const override;

 private:
  void advance();
  void step();
  // Goes farther in until the tissue is found, or is not within reach.
  void search();
  Vec3d wanted_m(std::uint64_t steps) const;

  const HandScript script_;
  const ClockUs clock_us_;
  const HandModel model_;
  std::uint64_t start_us_, steps_ = 0;
  bool is_searching_;
  double reach_m_ = 0;             // where depth counts from
  std::uint64_t found_steps_ = 0;  // when the script began
  std::uint64_t written_us_ = 0;   // the time of the force below
  Vec3d force_n_;
  Vec3d position_m_, velocity_m_s_;
  std::array<Vec3d, 60> lags_m_{};  // what the hand was behind its intention, one each step
};

}  // namespace trocar::device
