#pragma once

// Linear elasticity as matrices stored per node and edge (tensor-mass model, Cotin, Delingette and
// Ayache 2000): gradient of node i is the sum over edges of K_ij (u_j - u_i) with
//   K_ij = sum over tets with both of V [lambda g_i g_j^T + mu g_j g_i^T + mu (g_i . g_j) I],
// g the gradients of the linear shape functions, and the block is K_ii = -sum_j K_ij. Valid for
// small rotations: a body that turns is strained by it.

#include "server/tissue/dynamics/energy.h"

namespace trocar::dynamics {

class TensorMass final : public Energy {
 public:
  TensorMass(const topology::Topology& topology, const Groups& groups);

  void pack(const PackedLanes& pack) override;
  void add(Group group, const Float4* x, const Vec8& own, NodeStep8& step) const override;
  void linearise(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
                 StiffnessSink& sink) const override;
  void add_energies_j(std::span<const Vec3d> displacements,
                      std::span<double> energies) const override;
  std::size_t rebuild(const topology::Topology& topology, const Groups& groups,
                      std::span<const GroupLanes> lanes) override;

 private:
  struct Row {
    SlotLanes neighbour;
    Lanes k[3][3];  // N/m

    void pad(std::size_t lane, Slot own) { neighbour.v[lane] = own; }
  };
  struct Matrix {
    std::array<std::array<double, 3>, 3> m{};

    Vec3d operator*(const Vec3d& v) const;
    void add(const Matrix& b, double sign);
  };
  struct Edge {
    NodeIndex other;
    Matrix k;
  };
  struct Node {
    std::vector<Edge> edges;  // ascending
    Vec3d gradient_n;         // at rest, of tension and of the stress-free pose
    double energy_j = 0;      // likewise, its share
  };

  static Matrix edge_matrix(const Vec3d& gi, const Vec3d& gj, double volume,
                            const material::LameParameters& lame);
  static void find_edges(const topology::Topology& topology, NodeIndex node, Node& out);
  std::size_t fill(const topology::Topology& topology, const Groups& groups, GroupLanes lanes);
  void set_node(const Node& node, Slot slot);

  GroupRows<Row> rows_;
  GroupValues<SymMat3Lanes> blocks_;  // K_ii per group
  // This is the gradient of each group at rest, N, from tension and the stress-free pose.
  GroupValues<Vec3Lanes> rest_gradient_;
  std::vector<double> rest_energies_j_;  // per slot
  std::array<Node, kLanes> lane_nodes_;  // while rows are filled
};

}  // namespace trocar::dynamics
