#pragma once

// Devices of Force Dimension (delta, omega, sigma) and the Novint Falcon, through the maker's
// library libdhd, which the program looks for when it runs; its functions are declared here from
// its public documents.
//
// Frame of the device: x towards the person, y right, z up. Ours: (x, y, z) = (y', z', x').
//
// A call of the library waits for the device, so a thread of its own makes them, 1000 times a
// second. The device's watchdog is set to 100 ms: if this program dies, its motors go free. On
// closing: no force, dhdStop, dhdClose.

#include <memory>
#include <string>
#include <vector>

#include "client/device/haptic_device.h"

namespace trocar::device {

class ForceDimensionDevice final : public HapticDevice {
 public:
  // These are looked for, the best first.
  static std::vector<std::string> library_names() { return {"libdhd.so.3", "libdhd.so"}; }

  // `index`: among the devices that the library sees, from 0.
  static Result<std::unique_ptr<HapticDevice>> open(const std::vector<std::string>& names,
                                                    int index);
  // Counts the devices that the library sees.
  static Result<int> count(const std::vector<std::string>& names);
  ~ForceDimensionDevice() override;

  Result<DeviceReading> read() override;
  Status write(const Vec3d& force_n, const Vec3d& torque_nm) override;
  DeviceLimits limits() const override;
  std::string description() const override;

 private:
  struct Library;
  class Servo;

  static Result<Library> load(const std::vector<std::string>& names);

  explicit ForceDimensionDevice(std::unique_ptr<Servo> servo);

  std::unique_ptr<Servo> servo_;
};

}  // namespace trocar::device
