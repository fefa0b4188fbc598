#pragma once

// Hyperelastic tissue whose strain is averaged: a star of stress-free volume V and deformation
// gradient F (stars.h) has the energy
//   V [s (Psi(I1) - 2 C10 (J - 1)) + K/2 (J - 1)^2],   I1 = |F|^2, J = det F,
// with s = Stars::kAveragedBracket; the tets have the rest (hyperelastic.h). J is affine in each
// node, so that a node's block is exact and positive definite, as that of tets is. Constant strain
// is exact (patch test). Work per node and sweep: its neighbours.

#include "server/tissue/dynamics/energy.h"
#include "server/tissue/dynamics/psi.h"
#include "server/tissue/dynamics/stars.h"

namespace trocar::dynamics {

// As Energy, of stars where they are.
class StarEnergy {
 public:
  StarEnergy() = default;
  StarEnergy(const StarEnergy&) = delete;
  StarEnergy& operator=(const StarEnergy&) = delete;
  virtual ~StarEnergy() = default;

  virtual void add(Group group, NodeStep8& step) const = 0;
  virtual void add_energies_j(std::span<const Vec3d> displacements,
                              std::span<double> energies) const = 0;
  virtual void rebuild(const Groups& groups, std::span<const GroupLanes> lanes) = 0;
};

template <typename Law>
class AveragedStrain final : public StarEnergy {
 public:
  // Of stars whose material has this law; the stars must outlive it.
  AveragedStrain(const Topology& topology, const Groups& groups, const Stars& stars,
                 const HyperelasticParameters& of_law, const Law& law = {});

  void add(Group group, NodeStep8& step) const override;
  void add_energies_j(std::span<const Vec3d> displacements,
                      std::span<double> energies) const override;
  void rebuild(const Groups& groups, std::span<const GroupLanes> lanes) override;

 private:
  void set(const Groups& groups, Slot slot);

  const Stars& stars_;
  const Law law_;
  std::vector<std::uint8_t> is_of_law_;  // per material, as organ::material_at() counts
  bool has_others_ = false;              // stars of another law
  std::vector<float> is_own_;            // three per slot, 1 or 0; empty unless has_others_
};

extern template class AveragedStrain<NeoHookeanLaw>;
extern template class AveragedStrain<ReducedPolynomialLaw>;
extern template class AveragedStrain<ExponentialLaw>;

}  // namespace trocar::dynamics
