#pragma once

// Springs with damping between nodes (Choi 2002 eq. 1), as energies for the local solver.
//
// Elastic energy of a spring of stiffness k and rest length l0 between i and j: k/2 (|r| - l0)^2
// with r = x_j - x_i. (Eq. 1 as printed has the spring repel; the sign here is the attracting one.)
// Kelvin-Voigt damping along the spring, implicit over a step dt: b/(2 dt) (e . (r - r_start))^2
// with e the direction at the start of the step. Nodal damping d_i = rate m_i: d_i/(2 dt) |x_i -
// x_start|^2. The stiffness across a compressed spring is negative; its block is clamped to zero
// there, so every 3x3 block is positive semi-definite and the gradient stays exact.
//
// Layout: every spring is stored at both ends, so a node gathers and nothing scatters; a node's
// springs lie in batches of 8 (one AVX2 register per quantity), padded by springs of no stiffness.
// Lanes are always summed in the same order.

#include <span>
#include <vector>

#include "common/base/index.h"
#include "common/math/vec3.h"
#include "common/scene/organ.h"

namespace trocar::dynamics {

inline constexpr std::size_t kSpringLanes = 8;

class SpringNetwork {
 public:
  // What of a node's springs stays constant in a step: damping, along the directions at its start.
  struct alignas(32) StepTerms {
    float gx[kSpringLanes], gy[kSpringLanes], gz[kSpringLanes];  // sqrt(b/dt) e
    float offset[kSpringLanes];  // (gx, gy, gz) . (start_j - start_i)
  };

  explicit SpringNetwork(const scene::Organ& organ);

  // Nodal damping rate, 1/s: d_i = rate x m_i.
  float node_damping_per_s() const { return node_damping_per_s_; }

  std::size_t batch_count() const { return batches_.size(); }
  // Fills the node's entries of `terms` (batch_count() entries for the whole network) and returns
  // the damping's block, which is constant in the step. inverse_dt: 1/dt, or 0 for no damping.
  SymMat3f prepare_step(NodeIndex node, std::span<const Vec3f> start, float inverse_dt,
                        std::span<StepTerms> terms) const;
  // Adds gradient (N, minus the force) of springs and damping, and the block (N/m) of the springs.
  // x: displacements now; terms: from prepare_step.
  void add_gradient_and_block(NodeIndex node, std::span<const Vec3f> x,
                              std::span<const StepTerms> terms, Vec3f& gradient,
                              SymMat3f& block) const;

  // Elastic energy of the whole network in double, J: for tests and reports.
  double elastic_energy(std::span<const Vec3f> displacements) const;

 private:
  struct alignas(32) Batch {
    std::uint32_t neighbour[kSpringLanes];
    float rx[kSpringLanes], ry[kSpringLanes], rz[kSpringLanes];  // m, to the neighbour at rest
    float rest_length[kSpringLanes];                             // m
    float stiffness[kSpringLanes];                               // N/m
    float damping[kSpringLanes];                                 // N s/m
  };

  std::vector<std::uint32_t> offsets_;  // per node: its batches
  std::vector<Batch> batches_;
  float node_damping_per_s_ = 0;
};

}  // namespace trocar::dynamics
