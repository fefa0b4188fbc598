#pragma once

// A device that may be unplugged and plugged in again. While it is gone, read() says the last
// reading again with its old time, so that whoever renders forces lets go, and kRestsButton, so
// that its tool lets go of the tissue; a thread tries to open it once a second. When it is back,
// the first reading says that the hand has let go (kLetGoButton): the tool stays where it was,
// wherever the device is now.

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "client/device/haptic_device.h"

namespace trocar::device {

class ReturningDevice final : public HapticDevice {
 public:
  using Open = std::function<Result<std::unique_ptr<HapticDevice>>()>;

  // open: called here, and then on a thread of this class. An error is that of the first try.
  static Result<std::unique_ptr<HapticDevice>> open(Open open);
  ~ReturningDevice() override;

  Result<DeviceReading> read() override;
  Status write(const Vec3d& force_n, const Vec3d& torque_nm) override;
  DeviceLimits limits() const override { return limits_; }
  std::optional<OwnTool> own_tool() const override { return own_tool_; }
  std::string description() const override { return description_; }

 private:
  ReturningDevice(std::unique_ptr<HapticDevice> device, Open open);
  DeviceReading lose(Error why);
  void search(const std::stop_token& stop);

  const Open open_;
  // Those of the device that was opened first.
  const DeviceLimits limits_;
  const std::optional<OwnTool> own_tool_;
  const std::string description_;

  std::unique_ptr<HapticDevice> device_;  // null: it is gone
  DeviceReading last_;
  bool is_back_ = false;  // and has not been read yet

  // Passed to the thread and back.
  std::atomic<HapticDevice*> lost_{nullptr}, found_{nullptr};
  Error why_;  // written before lost_ is set
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;
};

}  // namespace trocar::device
