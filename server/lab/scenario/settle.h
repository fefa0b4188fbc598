#pragma once

// A prestressed rest pose: an organ at rest in equilibrium with its gravity and tension, so that it
// does not sag when a session starts. One thread; takes as long as the equilibrium takes to find.

#include "common/base/result.h"
#include "server/organs/organ/organ.h"

namespace trocar::scenario {

struct SettleOptions {
  double tolerance_n = 1e-6;  // root mean square of the force imbalance
  std::uint32_t max_sweeps = 200'000;
};

struct Settled {
  organ::Organ organ;
  double largest_move_m = 0, mean_move_m = 0;  // of a node, from the old rest pose
  float residual_n = 0;
  std::uint32_t sweeps = 0;
};

// The organ with `gravity_m_s2`, whose rest pose is the equilibrium and whose stress-free pose is
// the old one (or the old stress-free pose). Node ids stay. Error: nothing holds the organ, or no
// equilibrium is found, or a tet is turned inside out in it.
Result<Settled> settle(organ::Organ organ, const Vec3d& gravity_m_s2,
                       const SettleOptions& options = {});

}  // namespace trocar::scenario
