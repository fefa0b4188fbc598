#pragma once

#include <atomic>
#include <vector>

#include "client/device/haptic_device.h"

namespace trocar::haptics::testing {

// A device without a hand: it is where it is told, and keeps what was written last.
class FakeDevice : public device::HapticDevice {
 public:
  Result<device::DeviceReading> read() override {
    ++reads;
    if (is_gone) return Error{ErrorCode::ResourceMissing, "the device is gone"};
    return reading;
  }
  Status write(const Vec3d& force_n, const Vec3d& torque_nm) override {
    last_force_n = force_n;
    last_torque_nm = torque_nm;
    ++writes;
    return {};
  }
  device::DeviceLimits limits() const override {
    return {.force_n = 3.3, .torque_nm = 0.05, .rate_hz = 1000, .stiffness_n_m = 700};
  }
  std::string description() const override { return "fake"; }

  device::DeviceReading reading;
  std::atomic<bool> is_gone{false};
  std::atomic<int> reads{0}, writes{0};
  Vec3d last_force_n, last_torque_nm;
};

}  // namespace trocar::haptics::testing
