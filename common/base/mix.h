#pragma once

// Bits of a number spread over all 64: neighbours get values that share nothing that shows. Every
// function is one to one, and the same on every machine; none is for secrets.

#include <cstdint>

namespace trocar {

// The finisher of Steele's SplitMix64; 0 stays 0.
constexpr std::uint64_t mix_bits(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

// The number that SplitMix64 draws first from this state, also good for small ones and 0.
constexpr std::uint64_t splitmix64(std::uint64_t state) {
  return mix_bits(state + 0x9e3779b97f4a7c15u);
}

}  // namespace trocar
