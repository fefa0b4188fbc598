#pragma once

// A recorded hand as a device: its samples, in the world's frame, at the pace at which they were
// recorded, from the first read on; a tick of the session is a millisecond. It brings its tool, and
// what it feels moves nothing. Verbs are the gripper (grasp), the second button (cut) and
// kRestsButton (none). After the last sample it stays there and rests.

#include <cstdint>
#include <functional>

#include "client/device/haptic_device.h"
#include "client/replay/recorded_hand.h"

namespace trocar::device {

class JournalDevice final : public HapticDevice {
 public:
  using ClockUs = std::function<std::uint64_t()>;

  JournalDevice(replay::RecordedHand hand, ClockUs clock_us);

  Result<DeviceReading> read() override;
  Status write(const Vec3d&, const Vec3d&) override { return {}; }
  DeviceLimits limits() const override;
  std::string description() const override;
  std::optional<OwnTool> own_tool() const override;

 private:
  const replay::RecordedHand hand_;
  const ClockUs clock_us_;
  std::uint64_t start_us_ = 0;  // 0: nobody has read it yet
};

}  // namespace trocar::device
