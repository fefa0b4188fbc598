#pragma once

// When a hand's reading leaves for the server: at most so often while the hand moves, and again
// from time to time while it rests, so that the server knows that it is there.

#include <cmath>
#include <cstdint>

#include "client/haptics/hand.h"

namespace trocar::haptics {

struct ReadingPace {
  std::uint64_t shortest_ns = 3'900'000, keep_alive_ns = 20'000'000;
  double dead_band_m = 60e-6;   // a tip that is nearer to where it was sent rests
  float dead_turn = 0.999998f;  // cosine of half an angle, 4 mrad: likewise
};

// `sent`: the reading that left last, `since_ns` ago.
inline bool is_due(const HandReading& reading, const HandReading& sent, std::uint64_t since_ns,
                   const ReadingPace& pace = {}) {
  const bool is_same_verb = reading.verb == sent.verb;
  if (since_ns < pace.shortest_ns && is_same_verb) return false;
  const Quatf &a = reading.orientation, &b = sent.orientation;
  const float turn = a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
  const bool rests = length(reading.tip_m - sent.tip_m) < pace.dead_band_m &&
                     std::abs(turn) > pace.dead_turn && is_same_verb;
  return !rests || since_ns >= pace.keep_alive_ns;
}

}  // namespace trocar::haptics
