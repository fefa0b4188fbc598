#pragma once

// Linear elasticity as matrices stored per node and edge (tensor-mass model, Cotin, Delingette and
// Ayache 2000): gradient of node i is the sum over edges of K_ij (u_j - u_i) with
//   K_ij = sum over tets with both of V [lambda g_i g_j^T + mu g_j g_i^T + mu (g_i . g_j) I],
// g the gradients of the linear shape functions, and the block is K_ii = -sum_j K_ij. Valid for
// small rotations: a body that turns is strained by it.

#include "server/dynamics/energy.h"

namespace trocar::dynamics {

class TensorMass final : public Energy {
 public:
  TensorMass(const scene::Organ& organ, const Groups& groups);

  void add(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
           Scratch& scratch) const override;
  double energy_j(std::span<const Vec3d> displacements) const override;

 private:
  struct Row {
    SlotLanes neighbour;
    Lanes k[3][3];  // N/m

    void pad(std::size_t lane, Slot own) { neighbour.v[lane] = own; }
  };
  GroupRows<Row> rows_;
  std::vector<SymMat3Lanes> blocks_;  // K_ii per group
  std::vector<Vec3Lanes>
      rest_gradient_;  // N per group: of the rest pose against the stress-free one
  double rest_energy_j_ = 0;
};

}  // namespace trocar::dynamics
