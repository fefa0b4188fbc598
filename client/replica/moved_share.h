#pragma once

// Counts which vertices of the surface have ever been displaced by more than 1 mm.

#include <cstdint>
#include <vector>

#include "common/wire/quantise.h"

namespace trocar::replica {

class MovedShare {
 public:
  void count(const wire::QuantisedSurface& displacements) {
    if (has_moved_.size() < displacements.size()) has_moved_.resize(displacements.size(), 0);
    for (std::size_t i = 0; i < displacements.size(); ++i) {
      const std::int64_t x = displacements[i].x, y = displacements[i].y, z = displacements[i].z;
      if (has_moved_[i] != 0 || x * x + y * y + z * z <= kQuantaSquared) continue;
      has_moved_[i] = 1;
      ++count_;
    }
  }
  // Returns their share of all, 0 to 1.
  double share() const {
    return has_moved_.empty()
               ? 0.0
               : static_cast<double>(count_) / static_cast<double>(has_moved_.size());
  }

 private:
  static constexpr std::int64_t kQuantaSquared = 976;  // (1 mm / 32 um)^2 = 976.6

  std::vector<std::uint8_t> has_moved_;  // per vertex slot
  std::size_t count_ = 0;
};

}  // namespace trocar::replica
