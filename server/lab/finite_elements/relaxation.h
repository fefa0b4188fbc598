#pragma once

// Quasi-linear viscoelasticity as internal variables (Dogan 2011 eq. 2 to 4). The relaxing stress S
// leaves an overstress per Prony term,
//
//   h_k(t) = g_k int exp(-(t - s) / tau_k) dS/ds ds,   total = (1 - sum g_k) S + sum h_k,
//
// which over a step of dt in which S changes linearly is, with x = dt / tau_k, exactly
//
//   h_k <- exp(-x) h_k + g_k (1 - exp(-x)) / x (S_new - S_old)      (Taylor 1970).
//
// Stresses are of the second Piola-Kirchhoff kind: rotations leave them alone, and an organ that
// is free of stress stays so. dt = 0 is a sudden change, dt = infinity the wait for equilibrium.

#include <array>
#include <cmath>

#include "server/lab/finite_elements/stress.h"

namespace trocar::finite_elements {

// One material relaxes by these numbers over one step of time.
struct RelaxationStep {
  std::size_t term_count = 0;
  double equilibrium_share = 1;
  double tangent_share = 1;  // of the instantaneous tangent
  std::array<double, material::kMaxPronyTerms> decay{}, gain{};

  RelaxationStep() = default;
  RelaxationStep(const material::HyperelasticMaterial& material, double dt_s)
      : term_count(material.relaxation.size()),
        equilibrium_share(material.equilibrium_share()),
        tangent_share(equilibrium_share) {
    for (std::size_t k = 0; k < term_count; ++k) {
      const double x = dt_s / material.relaxation[k].relaxation_time_s;
      decay[k] = std::exp(-x);
      gain[k] = material.relaxation[k].weight * (x == 0          ? 1
                                                 : std::isinf(x) ? 0
                                                                 : -std::expm1(-x) / x);
      tangent_share += gain[k];
    }
  }
};

// One point remembers S at the end of the last step, then h_k per term. They stand in one array of
// six components each, so that a mesh keeps all of its points in one.
inline constexpr std::size_t kHistoryComponents = 6;
inline std::size_t history_size(std::size_t term_count) {
  return term_count == 0 ? 0 : kHistoryComponents * (term_count + 1);
}

// The relaxing part's stress at the end of the step, of S there; `history` is of the step's start.
inline Vector6 relaxed_stress(const RelaxationStep& step, const double* history,
                              const Vector6& stress) {
  if (step.term_count == 0) return stress;
  const Eigen::Map<const Vector6> before(history);
  Vector6 total =
      step.tangent_share * stress - (step.tangent_share - step.equilibrium_share) * before;
  for (std::size_t k = 0; k < step.term_count; ++k)
    total += step.decay[k] * Eigen::Map<const Vector6>(history + kHistoryComponents * (k + 1));
  return total;
}

// Makes `history` that of the step's end.
inline void advance_history(const RelaxationStep& step, double* history, const Vector6& stress) {
  if (step.term_count == 0) return;
  Eigen::Map<Vector6> before(history);
  for (std::size_t k = 0; k < step.term_count; ++k) {
    Eigen::Map<Vector6> overstress(history + kHistoryComponents * (k + 1));
    overstress = step.decay[k] * overstress + step.gain[k] * (stress - before);
  }
  before = stress;
}

}  // namespace trocar::finite_elements
