#pragma once

// Hyperelastic tets in edge-length form: with shape gradients g and w_ab = g_a . g_b,
//   W = Psi(I1) - 2 C10 (J - 1) + K/2 (J - 1)^2,   I1 = - sum over edges of w_ab |x_a - x_b|^2,
// I1 unsplit and J affine in each node, so that a node's block
//   V [2 Psi' w_aa I + Psi'' (dI1)(dI1)^T + K (dJ)(dJ)^T]
// is exact and positive definite and an inverted tet is no special case. Both brackets are free of
// stress at rest.
//
// Where strain is averaged (nodal_hyperelastic.h), tets have what is left to them. The mean volume
// of a node's tets may be right while one of them is inside out and the others too large; so a tet
// with less than kLeastVolume of its volume also has what was taken from it,
//   K/2 (J - kLeastVolume)^2,   J < kLeastVolume.

#include "server/tissue/dynamics/energy.h"
#include "server/tissue/dynamics/nodal_strain.h"
#include "server/tissue/dynamics/psi.h"
#include "server/tissue/topology/tet_shape.h"

namespace trocar::dynamics {

template <typename Law>
class Hyperelastic final : public Energy {
 public:
  // Acts on the tets whose material has parameters here. `strain` must outlive it; null means that
  // nothing is averaged.
  Hyperelastic(const topology::Topology& topology, const Groups& groups, const NodalStrain* strain,
               HyperelasticParameters parameters, const Law& law = {});

  void pack(const PackedLanes& pack) override;
  void add(Group group, const Float4* x, const Vec8& own, NodeStep8& step) const override;
  void linearise(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
                 StiffnessSink& sink) const override;
  void add_energies_j(std::span<const Vec3d> displacements,
                      std::span<double> energies) const override;
  std::size_t rebuild(const topology::Topology& topology, const Groups& groups,
                      std::span<const GroupLanes> lanes) override;

 private:
  // A tet seen from its node a; b, c, d complete it to positive volume.
  struct Row {
    SlotLanes b, c, d;
    Lanes wb, wc, wd;      // 2 C10 V w_ab, ..., N/m
    Vec3Lanes ab, bc, bd;  // rest pose, m
    Lanes volumetric;      // K / (36 V), Pa/m^3
    Lanes pressure;        // C10 / 3 + K / 6, Pa

    void pad(std::size_t lane, Slot own) { b.v[lane] = c.v[lane] = d.v[lane] = own; }
  };
  // Only laws that need I1 read these rows.
  struct InvariantRow {
    Lanes wbc, wbd, wcd;   // 2 C10 V w_bc, ..., N/m
    Lanes inverse_c10_v2;  // 1 / (2 C10 V), 1/J

    void pad(std::size_t, Slot) {}
  };
  // Only rows of averaged strain have these; a tet that has all of its own volumetric term has
  // zeros.
  struct GuardRow {
    Lanes stiffness;     // K / (36 V), Pa/m^3, of what is averaged
    Lanes least_volume;  // 6 kLeastVolume V, m^3

    void pad(std::size_t, Slot) {}
  };
  static constexpr double kLeastVolume = 0.2;
  struct RowShape;
  // A row has this stiffness against its volume, Pa/m^3, and this pressure, Pa.
  struct Volumetric {
    Float8 stiffness, pressure;
  };
  static Volumetric volumetric(const Row& row, const GuardRow* guard, const RowShape& shape);
  // Inlined whatever the compiler thinks: its result would go through memory, at twice the time.
  [[gnu::always_inline]] static inline RowShape shape(const Row& row, const Float4* x,
                                                      const Vec8& own);
  double row_energy(const Row& row, const InvariantRow* extra, const GuardRow* guard,
                    std::size_t lane, Slot own, std::span<const Vec3d> u) const;

  // This is a tet as seen from one of its nodes.
  struct At {
    mesh::Tet tet;
    double c10 = 0, bulk = 0;  // left to it, Pa
    double averaged_bulk = 0;  // Pa
    topology::TetShape shape;  // free of stress, of `tet`
  };
  void find_tets(const topology::Topology& topology, NodeIndex node, std::vector<At>& out) const;
  void extend(const Groups& groups);
  std::size_t fill(const topology::Topology& topology, const Groups& groups, GroupLanes lanes);
  void fill_lane(const topology::Topology& topology, const Groups& groups, std::span<const At> tets,
                 Group group, std::size_t lane);

  const Law law_;
  const NodalStrain* const nodal_strain_;
  const HyperelasticParameters parameters_;
  GroupRows<Row> rows_;
  GroupRows<InvariantRow> invariant_rows_;    // empty for a linear law
  GroupRows<GuardRow> guard_rows_;            // empty without averaged strain
  GroupValues<Vec3Lanes> constant_gradient_;  // N per group; linear laws
  GroupValues<Lanes> constant_block_;         // N/m per group; linear laws
  // While rows are filled.
  std::array<std::vector<At>, kLanes> tets_;
};

using NeoHookean = Hyperelastic<NeoHookeanLaw>;

extern template class Hyperelastic<NeoHookeanLaw>;
extern template class Hyperelastic<ReducedPolynomialLaw>;
extern template class Hyperelastic<ExponentialLaw>;

}  // namespace trocar::dynamics
