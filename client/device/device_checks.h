#pragma once

// A device says outside data, and gets orders that move a hand: both are checked here, whatever the
// backend.

#include <cstdint>
#include <optional>

#include "client/device/haptic_device.h"

namespace trocar::device {

// A backend renders a force for this long after it was written; then it renders none. So a program
// that hangs lets go of the hand.
inline constexpr std::uint64_t kForceHoldUs = 100'000;
// No device on a table reaches further, and no hand is faster.
inline constexpr double kFarthestM = 2, kFastestMS = 20;

// Returns microseconds of the monotonic clock.
std::uint64_t monotonic_us();

// Returns the reading with its orientation made a unit and its gripper between 0 and 1; nothing if
// a number is not finite, or is beyond what a device can reach.
std::optional<DeviceReading> checked(DeviceReading reading);

// Returns zero if a component is not finite; otherwise it is shortened to `limit`.
Vec3d checked_force(const Vec3d& force, double limit);

// Takes the rows of a rotation matrix, column vectors; nothing if it is none.
std::optional<Quatf> orientation_of(const double (&rows)[3][3]);

}  // namespace trocar::device
