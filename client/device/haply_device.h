#pragma once

// A Haply Inverse3, Inverse3x or Minverse with or without a VerseGrip, through the Inverse Service
// of its maker: JSON over a WebSocket on this computer (haply_messages.h). It renders forces, no
// torques.
//
//   service: inventory      us: force      service: state      us: force ...
//
// The service sends exactly one state for each message, so the pace is ours: one message each
// millisecond, and none before the last one was answered; a second without an answer is asked
// again. With nothing to feel the force is zero, which keeps the connection alive. On closing, zero
// goes last, and if the program crashes, too (crash.h). A thread of its own does all of it; read()
// and write() never wait.

#include <chrono>
#include <memory>

#include "client/device/haptic_device.h"

namespace trocar::device {

class HaplyDevice final : public HapticDevice {
 public:
  static constexpr const char* kUrl = "ws://localhost:10001";

  // Waits for the service no longer than `patience`; for the address of a host with a name, as long
  // as the system does.
  static Result<std::unique_ptr<HapticDevice>> open(
      const std::string& url, std::chrono::milliseconds patience = std::chrono::seconds(2));
  ~HaplyDevice() override;

  Result<DeviceReading> read() override;
  Status write(const Vec3d& force_n, const Vec3d& torque_nm) override;
  DeviceLimits limits() const override;
  std::string description() const override;

 private:
  class Conversation;

  explicit HaplyDevice(std::unique_ptr<Conversation> conversation);

  std::unique_ptr<Conversation> conversation_;
};

}  // namespace trocar::device
