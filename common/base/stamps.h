#pragma once

// Marks on what has numbers from 0 on. Taking all of them away costs nothing, so that scratch which
// is used anew a thousand times a second need not be cleared.

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace trocar {

class Stamps {
 public:
  // New places have no mark.
  void resize(std::size_t count) { stamps_.resize(count); }
  // Takes all marks away.
  void begin() {
    if (++current_ != 0) return;
    std::ranges::fill(stamps_, 0u);
    current_ = 1;
  }
  bool has(std::size_t i) const { return stamps_[i] == current_; }
  // Marks it, and returns whether it had no mark before.
  bool insert(std::size_t i) { return std::exchange(stamps_[i], current_) != current_; }

 private:
  std::vector<std::uint32_t> stamps_;
  std::uint32_t current_ = 1;
};

}  // namespace trocar
