#pragma once

// Pauses between tries of what may succeed later: each is longer than the one before by a factor,
// up to the longest. Thread: one.

#include <algorithm>
#include <chrono>

namespace trocar {

class Backoff {
 public:
  using Pause = std::chrono::nanoseconds;

  constexpr Backoff(Pause first, Pause longest, double factor)
      : first_(first), longest_(longest), factor_(factor), next_(first) {}

  // Returns how long to wait before the next try.
  Pause next() {
    const auto pause = next_;
    next_ = std::min(std::chrono::duration_cast<Pause>(next_ * factor_), longest_);
    return pause;
  }
  // The last try has succeeded.
  void restart() { next_ = first_; }

 private:
  Pause first_, longest_;
  double factor_;
  Pause next_;
};

}  // namespace trocar
