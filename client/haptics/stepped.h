#pragma once

// A loop runs one of these: it reads a device and writes to it, once in each period.

#include <cstdint>

#include "common/base/result.h"

namespace trocar::haptics {

class Stepped {
 public:
  virtual ~Stepped() = default;
  // An error: the device is gone.
  virtual Status step(std::uint64_t now_us) = 0;
  // Writes no force; the device may be gone.
  virtual void stop() = 0;
};

}  // namespace trocar::haptics
