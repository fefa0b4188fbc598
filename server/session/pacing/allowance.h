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

  // Returns whether `amount` was left.
  bool take(double amount, std::uint64_t now_ns) {
    const double elapsed_s = static_cast<double>(now_ns - last_ns_) * 1e-9;
    last_ns_ = now_ns;
    left_ = std::min(left_ + elapsed_s * per_second_, kMostSecondsAtOnce * per_second_) - amount;
    return left_ >= 0;
  }

 private:
  double per_second_, left_;
  std::uint64_t last_ns_;
};

}  // namespace trocar::pacing
