#pragma once

// The stage of rest. Tissue that nobody touches sleeps and is not solved, and a piece that cuts
// have set free moves as a whole (server/tissue/pieces/pieces.h). It stands around the solver: what
// is touched wakes before, and what the sweeps have done to free pieces is put right after.

#include "server/tissue/step/tick.h"

namespace trocar::step {

// Tissue sleeps, and pieces move as a whole, where it is swept in every tick: not in scenarios that
// load it.
bool may_rest(const TickDecisions& decisions, const ExternalLoads* loads);

// Wakes what is touched, or everything where nothing may rest. The pairs of what has woken are
// found in the same tick.
void wake_touched(bool may_rest, bool has_self_contact, State& state, pieces::Pieces& pieces,
                  ContactWork& contact);

// Tells the solver what has woken, and what is free. False: everything sleeps.
bool begin_solving(bool may_rest, const world::World& world, pieces::Pieces& pieces,
                   dynamics::BlockDescent& solver);

// Gives free pieces the motion that they must have, and lays to rest what has come to rest.
pieces::Pieces::Motion end_solving(bool may_rest, const contact::ContactList& contacts,
                                   world::World& world, pieces::Pieces& pieces,
                                   dynamics::BlockDescent& solver);

// Tells the solver which nodes have moved, woken or been laid to rest.
void hand_out_changes(const world::World& world, pieces::Pieces& pieces,
                      dynamics::BlockDescent& solver);

}  // namespace trocar::step
