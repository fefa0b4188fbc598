#pragma once

// Springs with dashpots beside them (Choi 2002 eq. 1), between nodes i and j at r = x_j - x_i.
//
// Elastic energy k/2 (|r| - l0)^2. (Eq. 1 as printed has the spring repel; here it attracts.) The
// dashpot resists the rate of the length (Kelvin-Voigt), implicit over a step dt from the length
// l_s at its start: potential b/(2 dt) (|r| - l_s)^2. The two together are one spring of stiffness
// k + b/dt, so damping costs a sweep nothing. The stiffness across a compressed spring is negative;
// it counts as zero in the block, which therefore is positive semi-definite; gradients are exact.
// Two nodes in one place have no direction between them: that spring is silent.

#include "server/tissue/dynamics/energy.h"

namespace trocar::dynamics {

class Springs final : public Energy {
 public:
  Springs(const topology::Topology& topology, const Groups& groups);
  // False: no material of the organ can have any.
  static bool are_needed(const organ::Organ& organ);

  void begin_group(Group group, const Float4* start, const Vec8& own, float inverse_dt) override;
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
    Vec3Lanes rest;   // m, to the neighbour at rest
    Lanes stiffness;  // k + b/dt, N/m
    Lanes pull;       // k l0 + b/dt l_s, N

    void pad(std::size_t lane, Slot own) { neighbour.v[lane] = own; }
  };
  struct Constants {
    Lanes stiffness;    // k, N/m
    Lanes damping;      // b, N s/m
    Lanes rest_length;  // l0, m

    void pad(std::size_t, Slot) {}
  };
  // This is a spring at a node, with the node at its other end.
  struct End {
    NodeIndex other;
    organ::Spring spring;
  };

  void find_springs(const topology::Topology& topology, NodeIndex node, std::vector<End>& out);
  std::size_t fill(const topology::Topology& topology, const Groups& groups, GroupLanes lanes);
  void update_step_length(Group group);

  GroupRows<Row> rows_;
  GroupRows<Constants> constants_;
  const bool has_damping_, has_elasticity_;
  float& inverse_dt_of(Group group) {
    return group < kFirstPack ? inverse_dts_[group] : packed_inverse_dts_[group - kFirstPack];
  }

  std::vector<float> inverse_dts_, packed_inverse_dts_;  // per group: in the stiffness of its rows
  // While rows are filled.
  std::array<std::vector<End>, kLanes> ends_;
  std::vector<std::pair<NodeIndex, TetIndex>> tets_beside_;
  std::vector<organ::SpringTet> tets_;
};

}  // namespace trocar::dynamics
