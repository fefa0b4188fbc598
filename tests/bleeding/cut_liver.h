#pragma once

// A small liver that a blade cuts along random strokes, with the blood of its frames.

#include <cstdint>
#include <functional>

#include "server/session/bleeding/bleeding.h"
#include "server/tissue/step/simulation.h"

namespace trocar::bleeding::testing {

// Called with each frame and the layout of its epoch.
using Observe = std::function<void(step::PublishedFrame& frame, step::Simulation& simulation)>;

// Cuts for so many ticks; equal seeds give equal strokes.
void cut_liver(std::uint64_t seed, Tick ticks, const Observe& observe);

}  // namespace trocar::bleeding::testing
