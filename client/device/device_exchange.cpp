#include "client/device/device_exchange.h"

#include <utility>

#include "client/device/crash.h"
#include "client/device/device_checks.h"

namespace trocar::device {

Result<DeviceReading> DeviceExchange::read() {
  if (has_failed()) return why_;
  return reading_.newest();
}

Status DeviceExchange::write(const Vec3d& force_n, const Vec3d& torque_nm,
                             const DeviceLimits& limits) {
  if (has_failed()) return why_;
  order_.put({checked_force(force_n, limits.force_n), checked_force(torque_nm, limits.torque_nm),
              monotonic_us()});
  return {};
}

bool DeviceExchange::publish(const DeviceReading& reading) {
  const auto plausible = checked(reading);
  if (plausible) reading_.put(*plausible);
  return plausible.has_value();
}

ForceOrder DeviceExchange::order(std::uint64_t now_us) {
  if (is_crashing()) return {};
  const ForceOrder& newest = order_.newest();
  return now_us <= newest.time_us + kForceHoldUs ? newest : ForceOrder{};
}

void DeviceExchange::fail(Error why) {
  const std::lock_guard lock(failing_);
  if (has_failed()) return;
  why_ = std::move(why);
  has_failed_.store(true, std::memory_order_release);
}

}  // namespace trocar::device
