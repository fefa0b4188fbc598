#pragma once

// Stands between the thread that holds a device in its program and the thread that talks to the
// device: readings go one way, forces the other, and so does the reason if the device is gone.
// Nobody waits.

#include <atomic>
#include <mutex>
#include <string>

#include "client/device/haptic_device.h"
#include "common/base/newest.h"

namespace trocar::device {

// A device that fails this many times in a row, about one a millisecond, is gone.
inline constexpr int kMostDeviceErrors = 20;

struct ForceOrder {
  Vec3d force_n, torque_nm;
  std::uint64_t time_us = 0;
};

class DeviceExchange {
 public:
  // The program's side. Before the first reading, read() gives one of time 0.
  Result<DeviceReading> read();
  Status write(const Vec3d& force_n, const Vec3d& torque_nm, const DeviceLimits& limits);

  // The device's side. A reading that is not plausible is left out, so that its time stands still;
  // true: it was taken.
  bool publish(const DeviceReading& reading);
  // Returns no force if the last one was written more than kForceHoldUs ago, or the program
  // crashes.
  ForceOrder order(std::uint64_t now_us);
  // The first reason counts. Any thread.
  void fail(Error why);
  bool has_failed() const { return has_failed_.load(std::memory_order_acquire); }

 private:
  Newest<DeviceReading> reading_;
  Newest<ForceOrder> order_;
  std::mutex failing_;
  std::atomic<bool> has_failed_{false};
  Error why_;  // written before has_failed_ is set
};

}  // namespace trocar::device
