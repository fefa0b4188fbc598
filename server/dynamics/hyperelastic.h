#pragma once

// Hyperelastic tets in edge-length form: with shape gradients g and w_ab = g_a . g_b,
//   W = Psi(I1) - 2 C10 (J - 1) + K/2 (J - 1)^2,   I1 = - sum over edges of w_ab |x_a - x_b|^2,
// I1 unsplit and J affine in each node, so that a node's block
//   V [2 Psi' w_aa I + Psi'' (dI1)(dI1)^T + K (dJ)(dJ)^T]
// is exact and positive definite and an inverted tet is no special case. Both brackets are free of
// stress at rest.
//
// Averaged volume (against locking; after Bonet and Burton 1998): the volumetric term is taken per
// node, W_vol = sum_a V_a K_a/2 (J_a - 1)^2, with J_a the ratio of current to rest volume of a's
// tets and V_a a quarter of that rest volume; J_a is affine in each node of the star. Its exact
// block is bounded by theta times the unaveraged one, theta found at rest; nodes need colours by
// Coupling::Stars. Volumes are summed as nodes move and anew at each step.

#include <optional>

#include "server/dynamics/energy.h"
#include "server/dynamics/psi.h"
#include "server/dynamics/tet_shape.h"

namespace trocar::dynamics {

// Per material, as scene::material_at() counts; nothing where it has another law.
using HyperelasticParameters = std::vector<std::optional<scene::NeoHookeanParameters>>;

template <typename Is>
HyperelasticParameters hyperelastic_parameters(const scene::Organ& organ, Is&& is) {
  HyperelasticParameters parameters(organ.regions.size() + 1);
  for (std::size_t m = 0; m < parameters.size(); ++m) {
    const auto& material = scene::material_at(organ, static_cast<std::uint16_t>(m));
    if (is(material)) parameters[m] = scene::neo_hookean_parameters(material);
  }
  return parameters;
}

template <typename Law>
class Hyperelastic final : public Energy {
 public:
  // Of the tets whose material has parameters here.
  Hyperelastic(const Topology& topology, const Groups& groups, bool has_averaged_volume,
               HyperelasticParameters parameters, const Law& law = {});

  void add(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
           Scratch& scratch) const override;
  void linearise(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
                 StiffnessSink& sink) const override;
  bool follows_moves() const override { return has_averaged_volume_; }
  void restart_group(Group group, const Float4* x) override;
  void after_move(Group group, const Vec8& dx, const Scratch& scratch) override;
  void add_energies_j(std::span<const Vec3d> displacements,
                      std::span<double> energies) const override;
  std::size_t rebuild(const Topology& topology, const Groups& groups,
                      std::span<const GroupLanes> lanes) override;

 private:
  // A tet seen from its node a; b, c, d complete it to positive volume.
  struct Row {
    SlotLanes b, c, d;
    Lanes wb, wc, wd;      // 2 C10 V w_ab, ..., N/m
    Vec3Lanes ab, bc, bd;  // rest pose, m
    Lanes volumetric;      // theta K / (36 V), Pa/m^3
    Lanes pressure;        // C10 / 3; K / 6 more if the volume is not averaged, Pa

    void pad(std::size_t lane, Slot own) { b.v[lane] = c.v[lane] = d.v[lane] = own; }
  };
  // What only laws that need I1 read.
  struct InvariantRow {
    Lanes wbc, wbd, wcd;   // 2 C10 V w_bc, ..., N/m
    Lanes inverse_c10_v2;  // 1 / (2 C10 V), 1/J

    void pad(std::size_t, Slot) {}
  };
  struct RowShape;
  // Inlined whatever the compiler thinks: its result would go through memory, at twice the time.
  [[gnu::always_inline]] static inline RowShape shape(const Row& row, const Float4* x,
                                                      const Vec8& own);
  template <bool kAveraged>
  void add_rows(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
                Scratch& scratch) const;
  double row_energy(const Row& row, const InvariantRow* extra, std::size_t lane, Slot own,
                    std::span<const Vec3d> u, double& star_change) const;

  // A tet at a node, seen from it.
  struct At {
    mesh::Tet tet;
    double c10 = 0, bulk = 0;  // Pa
    TetShape shape;            // free of stress, of `tet`
  };
  void find_tets(const Topology& topology, NodeIndex node, std::vector<At>& out) const;
  void extend(const Groups& groups);
  void set_star(const Topology& topology, NodeIndex node, Slot slot);
  double averaging_bound(const Groups& groups, std::span<const At> tets) const;
  std::size_t fill(const Topology& topology, const Groups& groups, GroupLanes lanes);
  void fill_lane(const Topology& topology, const Groups& groups, std::span<const At> tets,
                 Group group, std::size_t lane);

  const Law law_;
  const bool has_averaged_volume_;
  const HyperelasticParameters parameters_;
  GroupRows<Row> rows_;
  GroupRows<InvariantRow> invariant_rows_;    // empty for a linear law
  std::vector<Vec3Lanes> constant_gradient_;  // N per group; linear laws
  std::vector<Lanes> constant_block_;         // N/m per group; linear laws
  // Averaged volume, per slot: K_a over the star's stress-free volume (Pa/m^3), and that times the
  // change of the star's volume since free of stress (Pa).
  std::vector<float> star_stiffness_, star_pressure_;
  std::vector<double> star_offset_;  // change at zero displacement
  std::vector<double> star_weight_;  // K_a / (4 V_a), Pa/m^3
  // While rows are filled.
  std::array<std::vector<At>, kLanes> tets_;
  mutable std::vector<std::pair<NodeIndex, Vec3d>> star_motion_;
};

using NeoHookean = Hyperelastic<NeoHookeanLaw>;

extern template class Hyperelastic<NeoHookeanLaw>;
extern template class Hyperelastic<ReducedPolynomialLaw>;
extern template class Hyperelastic<ExponentialLaw>;

}  // namespace trocar::dynamics
