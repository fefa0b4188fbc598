#include "server/tissue/dynamics/far_plan.h"

#include <algorithm>

namespace trocar::dynamics {
namespace {

// One far sweep is stable up to omega = 4/3 (stiff limit), two up to 1.58: 1 + 3^(-1/k).
constexpr float kMaxFarOverRelaxationOneSweep = 1.33f;
constexpr float kMaxFarOverRelaxationTwoSweeps = 1.5f;
// Up to here omega* is what one sweep may have, 2 (1 + kappa) / (2 + kappa) <= 4/3.
constexpr float kMostKappaOneSweep = 1;

}  // namespace

FarPlan FarPlan::of(double stiffness, double mass, double dt) {
  FarPlan plan;
  if (!(mass > 0)) return plan;
  plan.kappa = static_cast<float>(dt * dt * stiffness / mass);
  return plan.with_sweeps(plan.kappa <= kMostKappaOneSweep ? 1 : 2);
}

FarPlan FarPlan::with_steps(std::uint32_t steps_per_tick) const {
  FarPlan plan = *this;
  if (steps_per_tick == 1) return plan;
  plan.kappa /= static_cast<float>(steps_per_tick * steps_per_tick);
  return plan.with_sweeps(plan.kappa <= kMostKappaOneSweep ? 1 : 2);
}

FarPlan FarPlan::with_interval(std::uint32_t steps) const {
  FarPlan plan = *this;
  if (steps == 1) return plan;
  plan.kappa *= static_cast<float>(steps * steps);
  plan = plan.with_sweeps(sweeps);
  // Groups that take turns see their neighbours where these coast to meanwhile, so that what a
  // sweep goes too far is shared by the steps of a turn. Without that the measured liver, held,
  // shakes for ever with turns of 3 and 4 steps; with turns of 3 already at 1.25, and not at 1.2.
  plan.over_relaxation = 1 + (plan.over_relaxation - 1) / static_cast<float>(steps);
  return plan;
}

FarPlan FarPlan::with_sweeps(std::uint32_t count) const {
  FarPlan plan = *this;
  if (count == 0) return plan;
  plan.sweeps = count;
  const float best = 2 * (1 + kappa) / (2 + kappa);
  plan.over_relaxation =
      std::min(best, count == 1 ? kMaxFarOverRelaxationOneSweep : kMaxFarOverRelaxationTwoSweeps);
  return plan;
}

}  // namespace trocar::dynamics
