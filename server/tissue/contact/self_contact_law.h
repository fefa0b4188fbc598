#pragma once

// How hard tissue presses tissue, from how far a pair begins, and how soon it is looked at again
// (self_contact.h).

#include "common/base/tick.h"

namespace trocar::contact {

// Pa/m, of both sides together: twice a tool's (contact_finder.h), for there is no hand that could
// back off. 10 kPa press walls 0.2 mm into each other.
inline constexpr float kSelfStiffnessPaPerM = 5e7f;
// Pairs are made when this near, or so many ticks before they touch at their present speed as there
// are from pass to pass and kSelfTicksAhead, but never from farther than kSelfMaxMargin_m: enough
// for 1.3 m/s.
inline constexpr float kSelfMargin_m = 0.001f, kSelfMaxMargin_m = 0.003f;
inline constexpr float kSelfTicksAhead = 0.5f;
inline constexpr float kDrift_m = 6.4e-6f, kNearDrift_m = 0.8e-6f, kLookDrift_m = 1e-4f;
// A pair that presses and drifts by so much in a tick is swept most.
inline constexpr float kSeedDrift_m = 1.28e-5f;
inline constexpr Tick kLookEvery = 64;  // a power of two
// From one pass to the next nothing goes farther than kPassDrift_m, if it goes on as fast.
inline constexpr Tick kPassEvery = 4;  // a power of two
inline constexpr float kPassDrift_m = 8e-4f;

// Returns the most ticks, a power of two, in which what moves at this speed stays within a way.
inline Tick ticks_within(float way_m, float squared_speed) {
  const float squared_way = way_m * way_m;
  Tick ticks = kLookEvery;
  while (ticks > 1) {
    const float seconds = kTickSeconds * static_cast<float>(ticks);
    if (squared_speed * (seconds * seconds) < squared_way) break;
    ticks /= 2;
  }
  return ticks;
}

}  // namespace trocar::contact
