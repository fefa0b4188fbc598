#pragma once

// A device that a hand holds. One thread opens, reads and writes it; a backend that needs threads
// of its own hides them.

#include <cstdint>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/math/frame.h"
#include "common/math/vec3.h"
#include "common/tool/tool.h"

namespace trocar::device {

// A button that no hand has: its tool is asked for nothing, and touches nothing.
inline constexpr std::uint32_t kRestsButton = 1u << 31;

// Another one that no hand has: the hand has let go of the device, or has just taken it again. The
// tool stays where it is, as with a clutch.
inline constexpr std::uint32_t kLetGoButton = 1u << 30;

// The tool of a device that brings its own, which then is where the device says.
struct OwnTool {
  tool::ToolShape shape;
  Vec3d start_m;  // of the tip, world frame: where the first reading is
};

struct DeviceReading {
  Vec3d position_m;  // in the device's frame: x right, y up, z towards the person
  Vec3d velocity_m_s;
  Quatf orientation;
  float gripper = 0;          // 0 open, 1 closed
  std::uint32_t buttons = 0;  // bit 0: the first
  std::uint64_t time_us = 0;  // monotonic clock of this reading
};

struct DeviceLimits {
  double force_n = 0, torque_nm = 0;  // 0: it renders none
  double rate_hz = 0;                 // readings a second
  double stiffness_n_m = 0;           // the stiffest contact that it renders without vibrating
  Vec3d workspace_m;                  // half of its reach along each axis
};

class HapticDevice {
 public:
  virtual ~HapticDevice() = default;
  // The newest reading, at once: it does not wait for the device. An error: the device is gone.
  virtual Result<DeviceReading> read() = 0;
  // Takes what the tissue does to the hand, in the device's frame, already cut to the limits.
  virtual Status write(const Vec3d& force_n, const Vec3d& torque_nm) = 0;
  virtual DeviceLimits limits() const = 0;
  virtual std::optional<OwnTool> own_tool() const { return std::nullopt; }
  virtual std::string description() const = 0;
};

}  // namespace trocar::device
