#pragma once

// How late a loop wakes, in bins that grow with the time: eight to the octave from 1 us on.

#include <array>
#include <cstdint>

namespace trocar::haptics {

class WakeStatistics {
 public:
  void add(double late_us);
  std::uint64_t count() const { return count_; }
  // The lateness that a share of all (0 to 1) does not exceed, within a bin, in us; 0 if there is
  // none.
  double quantile_us(double share) const;
  double worst_us() const { return worst_us_; }

 private:
  static constexpr std::size_t kBins = 8 * 24;  // up to 16 s

  std::array<std::uint64_t, kBins> bins_{};
  std::uint64_t count_ = 0;
  double worst_us_ = 0;
};

}  // namespace trocar::haptics
