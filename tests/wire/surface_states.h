#pragma once

// Random surfaces for the codec tests. The same seed gives the same surface on any machine.

#include <algorithm>
#include <cstdint>

#include "common/wire/quantise.h"

namespace trocar::wire::testing {

// SplitMix64; the standard distributions differ between libraries.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  std::uint64_t next() {
    std::uint64_t z = state_ += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
  }
  std::size_t below(std::size_t limit) { return static_cast<std::size_t>(next() % limit); }
  std::int32_t within(std::int32_t limit) {
    return static_cast<std::int32_t>(next() % (2u * static_cast<std::uint32_t>(limit) + 1)) - limit;
  }

 private:
  std::uint64_t state_;
};

inline QuantisedVertex random_vertex(Random& random, std::int32_t limit) {
  const auto x = random.within(limit), y = random.within(limit), z = random.within(limit);
  return {x, y, z};
}
inline QuantisedSurface random_surface(Random& random, std::size_t vertices, std::int32_t limit) {
  QuantisedSurface surface;
  for (std::size_t i = 0; i < vertices; ++i) surface.push_back(random_vertex(random, limit));
  return surface;
}
inline std::int32_t clamp_quanta(std::int32_t v) {
  return std::clamp(v, -kMaxQuanta, kMaxQuanta);
}

// Moves each vertex with probability 1 / `one_in` by at most `step` quanta per axis.
inline QuantisedSurface moved(Random& random, const QuantisedSurface& from, std::size_t one_in,
                              std::int32_t step) {
  QuantisedSurface to = from;
  for (QuantisedVertex& v : to) {
    if (random.below(one_in) != 0) continue;
    const QuantisedVertex d = random_vertex(random, step);
    v = {clamp_quanta(v.x + d.x), clamp_quanta(v.y + d.y), clamp_quanta(v.z + d.z)};
  }
  return to;
}

}  // namespace trocar::wire::testing
