#pragma once

#include <cstdint>
#include <vector>

#include "common/math/vec3.h"

namespace trocar::testing {

// Small and the same everywhere, so that a seed names a run.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed * 0x9e3779b97f4a7c15ull + 1) {}
  std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>(next() % n); }
  double unit() { return static_cast<double>(next() >> 11) / 9007199254740992.0; }
  double between(double low, double high) { return low + (high - low) * unit(); }

 private:
  std::uint64_t next() {
    state_ ^= state_ << 13, state_ ^= state_ >> 7, state_ ^= state_ << 17;
    return state_;
  }
  std::uint64_t state_;
};

// Returns vectors whose components lie between -amplitude and +amplitude.
inline std::vector<Vec3f> random_vectors(std::size_t count, float amplitude, std::uint64_t seed) {
  Random random(seed);
  const auto component = [&] { return amplitude * static_cast<float>(random.between(-1, 1)); };
  std::vector<Vec3f> vectors(count);
  for (auto& v : vectors) v = {component(), component(), component()};
  return vectors;
}

}  // namespace trocar::testing
