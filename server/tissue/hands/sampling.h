#pragma once

// Hands that a program moves tick by tick, as scenarios do, give samples as often as those in a
// session do: 125 in a second.

#include "common/base/tick.h"

namespace trocar::hands {

inline constexpr Tick kSampleTicks = 8;

// Returns whether a tick, from 1, takes samples.
inline bool takes_samples(Tick tick) {
  return tick % kSampleTicks == 1;
}

}  // namespace trocar::hands
