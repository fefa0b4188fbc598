#pragma once

// Hyperelastic tissue whose strain is averaged: a smoothing domain of stress-free volume V and
// deformation gradient F (nodal_strain.h) has the energy
//   V [s (Psi(I1) - 2 C10 (J - 1)) + K/2 (J - 1)^2],   I1 = |F|^2, J = det F,
// with s = NodalStrain::kAveragedBracket; the tets have the rest (hyperelastic.h). J is affine in
// each node, so that a node's block is exact and positive definite, as that of tets is. Constant
// strain is exact (patch test). Work per node and sweep: its neighbours.

#include "server/tissue/dynamics/energy.h"
#include "server/tissue/dynamics/nodal_strain.h"
#include "server/tissue/dynamics/psi.h"

namespace trocar::dynamics {

// Eight smoothing domains have this stress.
struct NodalStress8 {
  std::array<Vec8, NodalStrain::kRows> rows;  // of dW/dF, W the energy per volume, Pa
  // Times |b|^2, a node's b there, it is at least the stiffness against the node's moves, Pa/m^3.
  Float8 stiffness;
  // Is that of domains that are folded or drawn out, with what their shape adds, and 0 of all
  // others: overdamped, they can neither swing nor fly.
  Float8 drag;
};

// This is the counterpart of Energy for smoothing domains, evaluated at the gradients that
// NodalStrain keeps.
class NodalStrainEnergy {
 public:
  NodalStrainEnergy() = default;
  NodalStrainEnergy(const NodalStrainEnergy&) = delete;
  NodalStrainEnergy& operator=(const NodalStrainEnergy&) = delete;
  virtual ~NodalStrainEnergy() = default;

  virtual void add(Group group, NodeStep8& step) const = 0;
  // Adds the stress in the smoothing domains of the group's nodes, whose gradients are f.
  virtual void add_stress(Group group, const NodalStrain::Gradient& f,
                          NodalStress8& stress) const = 0;
  virtual void add_energies_j(std::span<const Vec3d> displacements,
                              std::span<double> energies) const = 0;
  virtual void rebuild(const Groups& groups, std::span<const GroupLanes> lanes) = 0;
};

template <typename Law>
class NodalHyperelastic final : public NodalStrainEnergy {
 public:
  // Acts on the smoothing domains whose material has this law. `strain` must outlive it.
  NodalHyperelastic(const topology::Topology& topology, const Groups& groups,
                    const NodalStrain& strain, const HyperelasticParameters& of_law,
                    const Law& law = {});

  void add(Group group, NodeStep8& step) const override;
  void add_stress(Group group, const NodalStrain::Gradient& f, NodalStress8& stress) const override;
  void add_energies_j(std::span<const Vec3d> displacements,
                      std::span<double> energies) const override;
  void rebuild(const Groups& groups, std::span<const GroupLanes> lanes) override;

 private:
  void set(const Groups& groups, Slot slot);

  const NodalStrain& nodal_strain_;
  const Law law_;
  std::vector<std::uint8_t> is_of_law_;  // per material, as organ::material_at() counts
  bool has_others_ = false;              // smoothing domains of another law
  std::vector<float> is_own_;            // three per slot, 1 or 0; empty unless has_others_
};

extern template class NodalHyperelastic<NeoHookeanLaw>;
extern template class NodalHyperelastic<ReducedPolynomialLaw>;
extern template class NodalHyperelastic<ExponentialLaw>;

}  // namespace trocar::dynamics
