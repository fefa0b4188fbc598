#pragma once

// Durations as counts in 32 buckets per octave, from 1 ns to 34 s: quantiles within 2 %, fixed
// size, no allocation. For reports.

#include <array>
#include <bit>
#include <cstdint>

namespace trocar::replication {

class DurationHistogram {
 public:
  void add(std::uint64_t ns) {
    ++buckets_[bucket_of(ns)];
    ++count_;
  }
  void clear() { *this = {}; }

  std::uint64_t count() const { return count_; }
  // Smallest duration that at least `share` of all are not above; 0 when empty.
  double quantile_us(double share) const {
    const double wanted = share * static_cast<double>(count_);
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i < buckets_.size(); ++i) {
      seen += buckets_[i];
      if (seen > 0 && static_cast<double>(seen) >= wanted) return middle_ns(i) / 1e3;
    }
    return 0;
  }

 private:
  static constexpr unsigned kBits = 5;  // sub-buckets per octave: 2^5
  static constexpr std::uint64_t kSub = 1u << kBits;
  static constexpr std::size_t kBuckets = (35 - kBits + 1) * kSub;

  // Below 32 ns one bucket per nanosecond, then (octave, next five bits).
  static std::size_t bucket_of(std::uint64_t ns) {
    if (ns < kSub) return static_cast<std::size_t>(ns);
    const auto shift = static_cast<unsigned>(std::bit_width(ns)) - 1 - kBits;
    const auto index = (shift + 1) * kSub + ((ns >> shift) - kSub);
    return index < kBuckets ? static_cast<std::size_t>(index) : kBuckets - 1;
  }
  static double middle_ns(std::size_t bucket) {
    if (bucket < kSub) return static_cast<double>(bucket);
    const auto shift = bucket / kSub - 1;
    const auto low = (kSub + bucket % kSub) << shift;
    return static_cast<double>(low) + static_cast<double>((std::uint64_t{1} << shift) - 1) / 2;
  }

  std::array<std::uint32_t, kBuckets> buckets_{};
  std::uint64_t count_ = 0;
};

}  // namespace trocar::replication
