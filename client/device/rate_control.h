#pragma once

// A device that says how fast the hand wants to go, not where it is: a stick or a cap on a spring.
// This integrates what it says into a position within a box, from its middle, and an orientation.

#include <cstdint>

#include "client/device/haptic_device.h"

namespace trocar::device {

// At the stop a stick moves the hand as fast as this, within half a box as large as this.
inline constexpr double kStickSpeedMS = 0.08, kStickTurnRadS = 1.2, kStickReachM = 0.15;

// Returns the share of the full deflection, -1 to 1, which is 0 up to `dead_zone` of it and grows
// from there: a stick at rest is never quite at 0. Not finite: 0.
double deflection(double value, double full, double dead_zone);

class RateControl {
 public:
  // Moves on to `now_us`. The speeds are those since the call before; of a pause of more than 50 ms
  // only 50 ms count, so that a program that stood still does not throw the hand.
  void advance(std::uint64_t now_us, const Vec3d& velocity_m_s, const Vec3d& turn_rad_s);

  // Position, velocity and orientation are set, the rest is not.
  const DeviceReading& reading() const { return reading_; }

 private:
  DeviceReading reading_;
  std::uint64_t last_us_ = 0;  // 0: never
};

}  // namespace trocar::device
