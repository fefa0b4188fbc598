#pragma once

// A 3D mouse (SpaceMouse, SpaceNavigator), through the socket of the daemon spacenavd: no library
// is needed, an event is eight 32-bit numbers.
//
//   [0] 0 motion: [1..6] x y z rx ry rz, counts of about 350 at the stop, z away from the person
//       1 press, 2 release: [1] button
//       3 device: [1] 0 added, 1 removed (daemons of protocol 1, which is asked for once)
//
// The cap is on a spring: what it says is a speed (rate_control.h). It renders no force.
//
// A cap at rest sends nothing, so silence is fresh; a cap that is deflected sends all the time:
// once it is silent for 100 ms the hand stops, and so does the time of the reading.

#include <array>
#include <cstddef>
#include <functional>
#include <memory>

#include "client/device/file_descriptor.h"
#include "client/device/haptic_device.h"
#include "client/device/rate_control.h"

namespace trocar::device {

class SpaceMouseDevice final : public HapticDevice {
 public:
  static constexpr const char* kSocket = "/var/run/spnav.sock";
  using ClockUs = std::function<std::uint64_t()>;

  // `clock_us`: monotonic microseconds, never 0.
  static Result<std::unique_ptr<HapticDevice>> open(const std::string& socket_path,
                                                    ClockUs clock_us);

  Result<DeviceReading> read() override;
  Status write(const Vec3d& force_n, const Vec3d& torque_nm) override;
  DeviceLimits limits() const override;
  std::string description() const override;

 private:
  using Event = std::array<std::int32_t, 8>;

  SpaceMouseDevice(FileDescriptor socket, ClockUs clock_us);

  Status take_bytes();
  void take(const Event& event, std::uint64_t now_us);

  FileDescriptor socket_;
  const ClockUs clock_us_;
  RateControl control_;
  Event event_{};          // as far as it has come
  std::size_t bytes_ = 0;  // of it
  Vec3d velocity_m_s_, turn_rad_s_;
  std::uint64_t last_event_us_ = 0;
  std::uint32_t buttons_ = 0;
  bool is_plugged_ = true;
};

}  // namespace trocar::device
