#pragma once

// Places of an organ's surface, spread over it: each as far as can be from the ones before and from
// what is fixed. O(count x surface nodes).

#include <span>
#include <vector>

#include "server/organs/organ/organ.h"

namespace trocar::calibration {

struct Place {
  NodeIndex node;
  Vec3f position;          // at rest, m
  Vec3f outward{0, 1, 0};  // unit
};

// The first is drawn by the seed, the others follow; `taken` are places from which to keep away
// too. Fewer than count if the organ has no more surface nodes that move.
std::vector<Place> spread_places(const organ::Organ& organ, std::size_t count, std::uint64_t seed,
                                 std::span<const Place> taken = {});

// Mean length of the edges between surface nodes, m.
double surface_edge_m(const organ::Organ& organ);

}  // namespace trocar::calibration
