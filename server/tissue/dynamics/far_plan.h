#pragma once

#include <cstdint>

namespace trocar::dynamics {

// How the far field of an organ wants to be swept at a step dt, from kappa = dt^2 D/m with D the
// mean stiffness of a node's block and m its mean mass: one sweep with omega* = 2 (1 + kappa) /
// (2 + kappa), for which a region that moves as a whole has its own inertia, while that is stable;
// else two.
struct FarPlan {
  float kappa = 0;
  std::uint32_t sweeps = 1;
  float over_relaxation = 1.3f;

  // Returns the plan for an organ with these sums over its free nodes: stiffness, N/m (traces of
  // blocks over 3), and mass, kg.
  static FarPlan of(double stiffness, double mass, double dt);
  // Returns this plan with another number of sweeps; 0 keeps the number.
  FarPlan with_sweeps(std::uint32_t count) const;
  // Returns this plan for sweeps in every so many steps.
  FarPlan with_interval(std::uint32_t steps) const;
  // Returns this plan for steps of time that are shorter by this ratio.
  FarPlan with_steps(std::uint32_t steps_per_tick) const;
};

}  // namespace trocar::dynamics
