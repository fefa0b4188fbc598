#pragma once

// When ticks are due. A tick that cuts may take as long as five, and those after it have room: what
// is behind is caught up with, back to back. More than a frame is given up: simulated time then
// runs slower than real time, counted. So nobody sees a burst, and a tick has the newest inputs
// however late it is. Pure arithmetic on the clock it is given, so that tests use a clock of their
// own.

#include <cstdint>

#include "common/base/tick.h"

namespace trocar::app {

class Pacer {
 public:
  explicit Pacer(std::uint64_t now_ns) : due_ns_(now_ns) {}

  // From now on ticks come at this rate of real time, over 0; nothing is to be caught up with.
  void restart(std::uint64_t now_ns, float rate) {
    due_ns_ = now_ns;
    period_ns_ = static_cast<std::uint64_t>(static_cast<float>(kTickNanoseconds) / rate);
  }

  // Returns the absolute time of the next tick.
  std::uint64_t due_ns() const { return due_ns_; }

  // The next tick begins at `now_ns` >= due_ns().
  void begin_tick(std::uint64_t now_ns) {
    const std::uint64_t due_count = (now_ns - due_ns_) / period_ns_ + 1;
    if (due_count > kMostBehind) {
      if (period_ns_ >= kTickNanoseconds) slow_ticks_ += due_count - kMostBehind;
      due_ns_ += (due_count - kMostBehind) * period_ns_;
    }
    due_ns_ += period_ns_;
  }

  // Ticks by which simulated time has fallen behind real time at that rate; faster than real time
  // nothing is late.
  std::uint64_t slow_ticks() const { return slow_ticks_; }

 private:
  static constexpr std::uint64_t kMostBehind = kTicksPerFrame;

  std::uint64_t due_ns_, period_ns_ = kTickNanoseconds;
  std::uint64_t slow_ticks_ = 0;
};

}  // namespace trocar::app
