#pragma once

// Claims: who may act on which nodes. A claim is a lease in ticks on a core of nodes: exclusive for
// a grasp, shared for a push. Requests are decided together at the end of a tick and valid from the
// next, in the order (tick of the first refusal, tool slot), so arrival order inside a tick cannot
// matter. All of the core or nothing; no hold and wait, so no deadlock.
//
// Life of a grasp:  wanted -> (refused, retried while the verb is held)* -> held -> released.
// A silent holder (no sample for 250 ticks) keeps its grasp, but others may take the core over; then
// its force ramps to zero in 100 ticks. If nobody does, it is held for 2,000 ticks and then ramped
// down over 500. A holder that leaves frees its core at once.

#include <array>
#include <span>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/ids.h"
#include "common/base/index.h"
#include "common/base/result.h"
#include "common/base/tick.h"
#include "common/scene/tool.h"

namespace trocar::locks {

inline constexpr Tick kLeaseTicks = 250;           // without a sample: others may take the core
inline constexpr Tick kAbandonTicks = 2000;        // without a sample: the grasp starts to ramp down
inline constexpr Tick kAbandonRampTicks = 500;
inline constexpr Tick kTakeoverRampTicks = 100;    // also when the holder leaves

enum class ClaimOutcome : std::uint8_t {
  Granted = 0,
  RefusedHeld = 1,
  RefusedNothingInReach = 2,
  Released = 3,
  TakenOver = 4,
  Expired = 5,
};

struct ClaimEvent {
  Tick tick = 0;
  ToolSlot tool;
  scene::Verb verb = scene::Verb::None;
  ClaimOutcome outcome = ClaimOutcome::Granted;
  ToolSlot holder;  // RefusedHeld: who holds it; TakenOver: who took it; else invalid
};

}  // namespace trocar::locks
