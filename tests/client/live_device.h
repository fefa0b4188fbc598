#pragma once

#include <atomic>
#include <cmath>
#include <numbers>

#include "common/base/timing.h"
#include "tests/haptics/fake_device.h"

namespace trocar::testing {

// A device whose readings are always new, until it is stuck; it rests, or goes to the right and
// back by 5 mm, twice a second.
class LiveDevice : public haptics::testing::FakeDevice {
 public:
  Result<device::DeviceReading> read() override {
    if (!is_stuck) reading.time_us = monotonic_ns() / 1000;
    const double turns = static_cast<double>(reading.time_us % 500'000) / 500'000;
    reading.position_m.x = moves ? 0.005 * std::sin(2 * std::numbers::pi * turns) : 0;
    return FakeDevice::read();
  }
  std::atomic<bool> moves{false}, is_stuck{false};
};

}  // namespace trocar::testing
