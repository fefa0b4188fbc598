#pragma once

// A small liver that a blade cuts along random strokes, and that bleeds.

#include <cstdint>
#include <functional>

#include "server/tissue/step/simulation.h"

namespace trocar::bleeding::testing {

// Called after each tick that publishes a frame.
using Observe = std::function<void(step::PublishedFrame& frame, step::Simulation& simulation)>;
// Called before each tick: may add to its inputs.
using Prepare = std::function<void(Tick tick, hands::TickInputs& inputs)>;

// Cuts for so many ticks; equal seeds give equal strokes.
void cut_liver(std::uint64_t seed, Tick ticks, const Observe& observe, const Prepare& prepare = {});

}  // namespace trocar::bleeding::testing
