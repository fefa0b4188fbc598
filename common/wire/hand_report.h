#pragma once

// A report tells a recording what a hand has felt: moments of a client's force loop, a few at once.
// Nothing that is simulated depends on it.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/base/ids.h"
#include "common/base/tick.h"
#include "common/math/vec3.h"

namespace trocar::wire {

// These safeguards may change a force before a hand gets it, in the order of the bits of `limits`.
inline constexpr std::size_t kHandLimits = 8;
inline constexpr std::array<const char*, kHandLimits> kHandLimitNames{
    "not finite", "stale reading", "jump", "old patch", "ramp", "passivity", "slew", "device"};

struct HandReport {
  static constexpr std::size_t kMostMoments = 8;
  static constexpr std::size_t kMostDeviceBytes = 64;

  struct Moment {
    std::uint64_t time_us = 0;  // of the client's clock; it grows
    Vec3f hand_force_n;         // as it was written to the device, turned into the world frame
    Vec3f model_force_n;        // of the local model on the tool, before any limit, world frame
    std::uint32_t answer_age_us = 0;  // since the newest answer came; 0 before the first
    std::uint32_t limits = 0;         // bits of those that acted since the moment before
  };

  std::uint8_t tool = 0;        // 0 or 1
  std::vector<Moment> moments;  // 1 to kMostMoments
  // The rest is of all of them.
  float echo_delay_s = 0;  // from a pose to the answer that belongs to it
  float rate_hz = 0;       // of the loop
  float motion_scale = 1;  // of the tool over the device
  float force_scale = 1;   // of the device over the tool
  std::string device;      // printable; empty: as said before
};

// A report as a recording has it.
struct HandRecord {
  ToolSlot tool;
  HandReport report;
  Tick tick = 0;  // of the newest frame when it came
  std::uint64_t echo_time_us =
      0;                       // of the client's clock, of the tool's pose in that tick; 0: unknown
  std::uint64_t left_out = 0;  // reports before it for which there was no room
};

}  // namespace trocar::wire
