#pragma once

// Loads of a finger or an instrument on an organ's surface, and where they are put: at rest, an
// even traction on a round patch. SI units; any thread.

#include <span>
#include <vector>

#include "server/organs/organ/organ.h"

namespace trocar::dogan {

struct Press {
  NodeIndex node;       // of the surface, the patch's centre
  Vec3d force_n;        // the whole
  double radius_m = 0;  // of the patch; 0: the node alone
};

struct NodeForce {
  NodeIndex node;
  Vec3d force_n;
};

// Surface nodes within the radius whose normal is on the centre's side, each with its share by
// area. Adds up to the press's force.
std::vector<NodeForce> node_forces(const organ::Organ& organ, const Press& press);

// Surface nodes whose patch holds no fixed node; all that are not fixed if there are none such.
std::vector<NodeIndex> accessible_nodes(const organ::Organ& organ, double radius_m);

// `count` of the candidates spread over the organ: each as far as can be from those before and from
// `taken`. The first without any `taken` is candidates[seed % size]. O(count x candidates).
std::vector<NodeIndex> spread_nodes(const organ::Organ& organ,
                                    std::span<const NodeIndex> candidates, std::size_t count,
                                    std::uint64_t seed, std::span<const NodeIndex> taken = {});

// Unit directions of the forces at a place. The first is straight, the others aslant by
// `slant_rad`, at azimuths that differ from press to press; all go in but every fifth, which pulls.
// `first`: number of the first among all presses of a set.
std::vector<Vec3d> press_directions(const Vec3d& outward, std::size_t first, std::size_t count,
                                    double slant_rad);

}  // namespace trocar::dogan
