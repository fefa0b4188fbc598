#pragma once

// A gamepad, through the kernel's event interface (linux/input.h, gamepads as in its gamepad.rst).
//
//   left stick     right and left, towards the person and away      right stick   up and down, turn
//   right trigger  closes the gripper                               buttons       south is bit 0
//
// A stick says a speed (rate_control.h). There are no forces; the pad's motors rumble with the size
// of the force instead, full at limits().force_n. A rumble lasts 0.2 s and is renewed, so that it
// ends by itself if this program does.
//
// A pad tells the kernel only what changes, so silence is fresh, also while a stick is held: a pad
// that hangs cannot be told from a quiet hand. One that is pulled out or out of reach is.

#include <linux/input.h>

#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/device/file_descriptor.h"
#include "client/device/haptic_device.h"
#include "client/device/rate_control.h"

namespace trocar::device {

class GamepadDevice final : public HapticDevice {
 public:
  using ClockUs = std::function<std::uint64_t()>;
  // The kernel's ioctl(): below 0 on failure.
  using Ioctl = std::function<int(int, unsigned long, void*)>;

  // `path`: such as /dev/input/event5. `clock_us`: monotonic microseconds, never 0.
  static Result<std::unique_ptr<HapticDevice>> open(const std::string& path, ClockUs clock_us);
  // Takes a descriptor that is open and does not block; `path` names it in errors.
  static Result<std::unique_ptr<HapticDevice>> adopt(FileDescriptor file, const std::string& path,
                                                     Ioctl ioctl, ClockUs clock_us);
  // Returns the paths of the gamepads in a folder such as /dev/input.
  static std::vector<std::string> find(const std::string& folder);
  ~GamepadDevice() override;

  Result<DeviceReading> read() override;
  Status write(const Vec3d& force_n, const Vec3d& torque_nm) override;
  DeviceLimits limits() const override;
  std::string description() const override;

 private:
  struct Axis {
    int code;
    double lowest = 0, highest = 0, value = 0;  // lowest == highest: there is none

    double centred() const;  // -1 to 1, with a dead zone
    double pressed() const;  // 0 to 1
  };
  enum AxisName { kLeftX, kLeftY, kRightX, kRightY, kTrigger };

  GamepadDevice(FileDescriptor file, std::string path, Ioctl ioctl, ClockUs clock_us);

  Status take_events();
  void take(const input_event& event);
  void ask_state();
  Status rumble(double strength);
  Error gone() const;

  FileDescriptor file_;
  const std::string path_;
  const Ioctl ioctl_;
  const ClockUs clock_us_;
  std::string name_;
  RateControl control_;
  std::array<Axis, 5> axes_{{{ABS_X}, {ABS_Y}, {ABS_RX}, {ABS_RY}, {ABS_RZ}}};
  std::uint32_t buttons_ = 0;
  bool is_dropped_ = false;  // events were lost; until the next report
  std::array<input_event, 64> events_{};
  std::size_t bytes_ = 0;  // of an event that has not come whole
  bool has_rumble_ = false;
  ff_effect effect_{};
  double strength_ = 0;  // of the rumble, 0 to 1
  std::uint64_t rumble_us_ = 0;
};

}  // namespace trocar::device
