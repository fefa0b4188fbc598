#pragma once

// This bounds what a client may send: so much per second, and what it has not used for up to 15 s.
// It is no flood when a client or server that slept finds so much waiting.

#include <algorithm>
#include <cstdint>

namespace trocar::pacing {

class Allowance {
 public:
  static constexpr double kMostSecondsAtOnce = 15;

  Allowance(double per_second, std::uint64_t now_ns)
      : per_second_(per_second), left_(per_second), last_ns_(now_ns) {}

  // Returns whether `amount` was left. It is taken also where it was not: who goes on gets nothing.
  bool take(double amount, std::uint64_t now_ns) {
    refill(now_ns);
    left_ -= amount;
    return left_ >= 0;
  }
  // Returns whether `amount` was left, and takes nothing where it was not.
  bool take_if_left(double amount, std::uint64_t now_ns) {
    refill(now_ns);
    if (left_ < amount) return false;
    left_ -= amount;
    return true;
  }

 private:
  void refill(std::uint64_t now_ns) {
    const double elapsed_s = static_cast<double>(now_ns - last_ns_) * 1e-9;
    last_ns_ = now_ns;
    left_ = std::min(left_ + elapsed_s * per_second_, kMostSecondsAtOnce * per_second_);
  }

  double per_second_, left_;
  std::uint64_t last_ns_;
};

}  // namespace trocar::pacing
