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
  // Takes the force away in the steps from now on, no faster than a hand bears. Returns whether
  // none is left.
  virtual bool let_go() = 0;
  // Writes no force at once; the device may be gone.
  virtual void stop() = 0;
};

}  // namespace trocar::haptics
