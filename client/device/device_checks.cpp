#include "client/device/device_checks.h"

#include <algorithm>
#include <cmath>

#include "common/base/timing.h"

namespace trocar::device {
namespace {

// Makers print their matrices with six digits, and some do not renormalise them.
constexpr double kMatrixTolerance = 1e-2;

Vec3d row(const double (&values)[3]) {
  return {values[0], values[1], values[2]};
}

}  // namespace

std::uint64_t monotonic_us() {
  return monotonic_ns() / 1000;
}

std::optional<DeviceReading> checked(DeviceReading reading) {
  // A comparison with a NaN is false.
  if (!(length(reading.position_m) <= kFarthestM)) return std::nullopt;
  if (!(length(reading.velocity_m_s) <= kFastestMS)) return std::nullopt;
  const float size = norm(reading.orientation);
  if (!(size >= 0.5f && size <= 2.0f)) return std::nullopt;
  if (!std::isfinite(reading.gripper)) return std::nullopt;
  reading.orientation = normalized(reading.orientation);
  reading.gripper = std::clamp(reading.gripper, 0.0f, 1.0f);
  return reading;
}

Vec3d checked_force(const Vec3d& force, double limit) {
  const double size = length(force);
  if (!std::isfinite(size)) return {};
  return size > limit ? force * (limit / size) : force;
}

std::optional<Quatf> orientation_of(const double (&rows)[3][3]) {
  const Vec3d a = row(rows[0]), b = row(rows[1]), c = row(rows[2]);
  const bool is_rotation = std::abs(length_squared(a) - 1) < kMatrixTolerance &&
                           std::abs(length_squared(b) - 1) < kMatrixTolerance &&
                           length_squared(cross(a, b) - c) < kMatrixTolerance * kMatrixTolerance;
  if (!is_rotation) return std::nullopt;
  // The largest of the four components is at least 1/2, and is divided by.
  const double squares[4] = {1 + a.x - b.y - c.z, 1 - a.x + b.y - c.z, 1 - a.x - b.y + c.z,
                             1 + a.x + b.y + c.z};
  const auto largest = std::max_element(squares, squares + 4) - squares;
  const double twice = std::sqrt(squares[largest]);
  double q[4];
  q[largest] = twice / 2;
  const double s = 0.5 / twice;
  if (largest == 3)
    q[0] = (c.y - b.z) * s, q[1] = (a.z - c.x) * s, q[2] = (b.x - a.y) * s;
  else if (largest == 0)
    q[3] = (c.y - b.z) * s, q[1] = (b.x + a.y) * s, q[2] = (a.z + c.x) * s;
  else if (largest == 1)
    q[3] = (a.z - c.x) * s, q[0] = (b.x + a.y) * s, q[2] = (c.y + b.z) * s;
  else
    q[3] = (b.x - a.y) * s, q[0] = (a.z + c.x) * s, q[1] = (c.y + b.z) * s;
  return normalized(Quatf{static_cast<float>(q[0]), static_cast<float>(q[1]),
                          static_cast<float>(q[2]), static_cast<float>(q[3])});
}

}  // namespace trocar::device
