#pragma once

// How forces of averaged strain (nodal_strain.h) enter a step of time.
//
// Implicit: a solver asks for them at each move of a node. A node's moves then reach its
// neighbours' neighbours, which needs more colours than elements do.
//
// Explicit: they are taken where the tissue is when a step begins, and are constant in it; all
// other forces are implicit as ever. A mode of these forces that has the stiffness k and the mass m
// is stable as long as dt^2 k < 4 m, as in the leapfrog method; implicit forces only add to that.
// Light nodes get as much inertia in addition as that takes, against what would change their
// velocity. A session's step of 1 ms needs little of it in soft tissue of elements of some
// millimetres, and then forces are as true as if solved for. Of stiffer or finer tissue it would
// make another body: scheme_for() says when. Where tissue tears, strands are stretched and folded
// until their forces are no longer what that bound was found for, and nothing stops what then
// swings: such organs are solved implicitly.

#include <cstdint>

#include "server/organs/organ/organ.h"
#include "server/tissue/world/world.h"

namespace trocar::dynamics {

enum class StrainScheme : std::uint8_t { Implicit, Explicit };

// The second derivatives of these forces over all nodes together are at most this many times the
// diagonal matrix of the nodes' stiffness (Tissue::nodal_forces). Organs have 4.2 to 4.7, flat tets
// 5.2, by power iteration.
inline constexpr float kMostStiffness = 6;
// With dt^2 k < 4 m: nodes have at least this inertia, in parts of their stiffness; where one sweep
// moves them by omega times Newton's step, omega times as much.
inline constexpr float kLeastInertia = kMostStiffness / 4;

// Returns the scheme for ticks of a session with steps of dt, s: Explicit unless tissue can tear,
// or it would add more than 12 % to the inertia of what moves. O(organ).
StrainScheme scheme_for(const organ::Organ& organ, const world::World& world, float dt);

}  // namespace trocar::dynamics
