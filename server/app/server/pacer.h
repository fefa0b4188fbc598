#pragma once

// When ticks are due. At most two run back to back to catch up; what is further behind is given up:
// simulated time then runs slower than real time, counted, never a burst. Pure arithmetic on the
// clock it is given, so that tests use a clock of their own.

#include <cstdint>

#include "common/base/tick.h"

namespace trocar::app {

class Pacer {
 public:
  explicit Pacer(std::uint64_t now_ns) : due_ns_(now_ns) {}

  // Returns the absolute time of the next tick.
  std::uint64_t due_ns() const { return due_ns_; }

  // The next tick begins at `now_ns` >= due_ns().
  void begin_tick(std::uint64_t now_ns) {
    const std::uint64_t due_count = (now_ns - due_ns_) / kTickNanoseconds + 1;
    if (due_count > kBackToBack) {
      slow_ticks_ += due_count - kBackToBack;
      due_ns_ += (due_count - kBackToBack) * kTickNanoseconds;
    }
    due_ns_ += kTickNanoseconds;
  }

  // Ticks by which simulated time has fallen behind real time.
  std::uint64_t slow_ticks() const { return slow_ticks_; }

 private:
  static constexpr std::uint64_t kBackToBack = 2;

  std::uint64_t due_ns_;
  std::uint64_t slow_ticks_ = 0;
};

}  // namespace trocar::app
