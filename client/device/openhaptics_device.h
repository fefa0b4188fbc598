#pragma once

// Devices of 3D Systems (Touch, Touch X, formerly Phantom Omni and Desktop), through the maker's
// library libHD of OpenHaptics, which the program looks for when it runs; its functions are
// declared here from its public documents.
//
// Frame of the device: x right, y up, z towards the person, as ours, in mm; the middle of the
// usable workspace is our origin. The library calls us back about 1000 times a second on a thread
// of its own: there the newest reading and the newest force are exchanged. It renders forces, no
// torques.
//
// One of these devices at a time: the library has one scheduler.

#include <memory>
#include <string>
#include <vector>

#include "client/device/haptic_device.h"

namespace trocar::device {

class OpenHapticsDevice final : public HapticDevice {
 public:
  static constexpr const char* kDefaultDevice = "Default Device";
  // These are looked for, the best first.
  static std::vector<std::string> library_names() { return {"libHD.so", "libHD.so.3.4"}; }

  // `name`: of the device, as the maker's setup program calls it.
  static Result<std::unique_ptr<HapticDevice>> open(const std::vector<std::string>& names,
                                                    const std::string& name);
  // Returns an error if the library is not there or not whole.
  static Status check_library(const std::vector<std::string>& names);
  ~OpenHapticsDevice() override;

  Result<DeviceReading> read() override;
  Status write(const Vec3d& force_n, const Vec3d& torque_nm) override;
  DeviceLimits limits() const override;
  std::string description() const override;

 private:
  struct Library;
  class Servo;

  static Result<Library> load(const std::vector<std::string>& names);

  explicit OpenHapticsDevice(std::unique_ptr<Servo> servo);

  std::unique_ptr<Servo> servo_;
};

}  // namespace trocar::device
