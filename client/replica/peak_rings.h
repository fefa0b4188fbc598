#pragma once

// Curves of a few quantities over the last time, for small plots: per quantity a ring of bins, each
// with the greatest value that fell into it, so that a short peak is not lost between two samples.
//
// A bin of which nobody told is as the one before it, for kGap bins; after that 0. Bounded whatever
// comes. One thread.

#include <algorithm>
#include <array>
#include <cstdint>

namespace trocar::replica {

template <std::size_t Count, std::size_t Bins, std::uint64_t Gap>
class PeakRings {
 public:
  using Values = std::array<float, Count>;  // >= 0

  void clear() {
    for (auto& ring : rings_) ring.fill(0);
    is_empty_ = true;
  }

  // Bins in any order that does not go back; earlier ones are ignored.
  void add(std::uint64_t bin, const Values& values) {
    if (is_empty_) newest_bin_ = bin;
    if (bin < newest_bin_) return;
    const std::uint64_t passed = bin - newest_bin_;
    for (auto& ring : rings_) {
      const float last = ring[static_cast<std::size_t>(newest_bin_ % Bins)];
      // Beyond a whole turn, all bins are passed over.
      for (std::uint64_t step = 0; step < std::min<std::uint64_t>(passed, Bins); ++step)
        ring[static_cast<std::size_t>((bin - step) % Bins)] =
            step == 0 || passed - step > Gap || passed > Bins ? 0 : last;
    }
    newest_bin_ = bin;
    is_empty_ = false;
    for (std::size_t i = 0; i < Count; ++i) {
      float& value = rings_[i][static_cast<std::size_t>(bin % Bins)];
      value = std::max(value, values[i]);
    }
  }

  // The bins of one quantity, oldest first, the bin that is being filled last.
  std::array<float, Bins> oldest_first(std::size_t i) const {
    std::array<float, Bins> out{};
    if (is_empty_) return out;
    for (std::size_t k = 0; k < Bins; ++k)
      out[k] = rings_[i][static_cast<std::size_t>((newest_bin_ + 1 + k) % Bins)];
    return out;
  }

  // The greatest of all quantities.
  float greatest() const {
    float most = 0;
    for (const auto& ring : rings_) most = std::max(most, *std::ranges::max_element(ring));
    return most;
  }

 private:
  std::array<std::array<float, Bins>, Count> rings_{};
  std::uint64_t newest_bin_ = 0;
  bool is_empty_ = true;
};

}  // namespace trocar::replica
