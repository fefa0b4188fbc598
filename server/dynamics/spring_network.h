#pragma once

// Springs with damping between nodes (Choi 2002 eq. 1), as energies for the local solver.
//
// Elastic energy of a spring of stiffness k and rest length l0 between i and j: k/2 (|r| - l0)^2
// with r = x_j - x_i. (Eq. 1 as printed has the spring repel; the sign here is the attracting one.)
// Kelvin-Voigt damping along the spring, implicit over a step dt: b/(2 dt) (e . (r - r_start))^2
// with e the direction at the start of the step. Nodal damping d_i = rate m_i: d_i/(2 dt) |x_i -
// x_start|^2. The stiffness across a compressed spring is negative; its block is clamped to zero
// there, so every 3x3 block is positive semi-definite and the gradient stays exact. Springs are
// stored per node, both ends, so a node gathers and nothing scatters.

#include <span>
#include <vector>

#include "common/base/index.h"
#include "common/math/vec3.h"
#include "common/scene/organ.h"

namespace trocar::dynamics {

struct HalfSpring {
  NodeIndex neighbour;
  Vec3f rest_vector;      // m, from this node to the neighbour at rest
  float rest_length = 0;  // m
  float stiffness = 0;    // N/m
  float damping = 0;      // N s/m
};

class SpringNetwork {
 public:
  explicit SpringNetwork(const scene::Organ& organ);

  std::span<const HalfSpring> springs(NodeIndex node) const {
    return std::span(half_springs_)
        .subspan(offsets_[node.value], offsets_[node.value + 1] - offsets_[node.value]);
  }
  float node_damping_per_s() const { return node_damping_per_s_; }

  // Gradient (N, minus the force) and block (N/m) of the springs around `node` are added.
  // x: displacements now; start: at the start of the step; inverse_dt: 1/dt, or 0 for no damping.
  void add_gradient_and_block(NodeIndex node, std::span<const Vec3f> x,
                              std::span<const Vec3f> start, float inverse_dt, Vec3f& gradient,
                              SymMat3f& block) const;

  // Elastic energy of the whole network in double, J: for tests and reports.
  double elastic_energy(std::span<const Vec3f> displacements) const;

 private:
  std::vector<std::uint32_t> offsets_;
  std::vector<HalfSpring> half_springs_;
  float node_damping_per_s_ = 0;
};

}  // namespace trocar::dynamics
