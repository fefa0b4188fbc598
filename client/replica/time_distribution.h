#pragma once

// Times between 0 and 20 s, counted in bins of 1 ms; what is longer counts as 20 s.

#include <cstdint>
#include <vector>

namespace trocar::replica {

class TimeDistribution {
 public:
  void add(double milliseconds);
  std::uint64_t count() const { return count_; }
  // The time that a share of all (0 to 1) does not exceed, in ms; 0 if there is none.
  double quantile_ms(double share) const;

 private:
  std::vector<std::uint64_t> bins_;
  std::uint64_t count_ = 0;
};

}  // namespace trocar::replica
