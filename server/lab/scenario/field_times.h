#pragma once

// When a run writes the whole organ: at the first step that reaches a time asked for, times of the
// run's start included. One that ends half a step before it does, too, and at most half a
// millisecond, which is what files' names tell.

#include <algorithm>
#include <cstddef>
#include <span>

namespace trocar::scenario {

class FieldTimes {
 public:
  // Increasing; steps of `step_s`. The times must stay where they are.
  FieldTimes(std::span<const double> times_s, double step_s)
      : times_s_(times_s), tolerance_s_(std::min(step_s, 1e-3) / 2) {}

  // Whether a time that was not due before is due now. To be asked in order of time.
  bool pop_due(double now_s) {
    const std::size_t before = next_;
    while (next_ < times_s_.size() && times_s_[next_] <= now_s + tolerance_s_) ++next_;
    return next_ > before;
  }

 private:
  std::span<const double> times_s_;
  double tolerance_s_;
  std::size_t next_ = 0;
};

}  // namespace trocar::scenario
