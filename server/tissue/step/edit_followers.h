#pragma once

// An edit of the topology has many followers. This is the only place that lists them, in the order
// that they need: whoever keeps something by node, tet or triangle gets a line here.

#include "server/tissue/step/tick.h"
#include "server/tissue/topology/edit.h"

namespace trocar::step {

// Hands the edit to all of the state; then the work made for it is out of date.
void hand_out(const topology::Edit& edit, State& state);

// Hands it to the work that follows from the state, whose world has it already.
void hand_out(const topology::Edit& edit, const world::World& world, ContactWork& contact,
              NearWork& near, SolveWork& solve);

// Hands an edit of this tick to both.
void hand_out(const topology::Edit& edit, State& state, pieces::Pieces& pieces,
              ContactWork& contact, NearWork& near, SolveWork& solve);

}  // namespace trocar::step
