#pragma once

// The stage of ties: after the solve each remembers how far it has been pulled, and breaks where
// that is too far, or where the edge of a blade has gone through it. Who holds a node of a tie
// holds the tie: no other blade cuts it.
//
// The memory of a broken tie is kBrokenAt times what breaks it, so that snapshot and hash have all
// breaks with the memories. Work: O(ties).

#include "server/tissue/step/tick.h"

namespace trocar::step {

inline constexpr double kBrokenAt = 2;

// Ties of the state that are broken by their memories become so in its topology: after reading.
void read_breaks(blades::TissueCuts& cuts, const world::World& world);

// Returns how many ties have broken in this tick, and how many are left.
TieReport follow_ties(std::uint32_t waiting_tools, State& state, StepContext& context);

}  // namespace trocar::step
