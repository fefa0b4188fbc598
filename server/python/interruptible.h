#pragma once

// Work that takes long runs without Python's lock, so that other threads go on, and looks for
// Ctrl-C between its ticks.

#include <pybind11/pybind11.h>

#include <cstdint>

#include "common/base/timing.h"

namespace trocar::python {

class Interruptible {
 public:
  // Call it between two ticks, without the lock. Throws KeyboardInterrupt after Ctrl-C.
  void check() {
    const std::uint64_t now = monotonic_ns();
    if (now < next_) return;
    next_ = now + kEvery_ns;
    const pybind11::gil_scoped_acquire lock;
    if (PyErr_CheckSignals() != 0) throw pybind11::error_already_set();
  }

 private:
  static constexpr std::uint64_t kEvery_ns = 50'000'000;
  std::uint64_t next_ = monotonic_ns() + kEvery_ns;
};

}  // namespace trocar::python
