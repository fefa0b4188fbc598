#pragma once

// The energies of one organ, on its nodes' colours: what a solver or integrator asks for gradients.

#include <memory>
#include <vector>

#include "server/dynamics/energy.h"

namespace trocar::dynamics {

class Tissue {
 public:
  explicit Tissue(const scene::Organ& organ);

  const Groups& groups() const { return groups_; }
  bool follows_moves() const { return follows_moves_; }

  void begin_step(float inverse_dt);
  void begin_group(Group group, const Float4* start);
  void restart_group(Group group, const Float4* x);
  void after_move(Group group, const Vec8& dx, const Scratch& scratch);
  void add(Group group, const Float4* x, const Vec8& own, NodeStep8& step, Scratch& scratch) const {
    for (const auto& energy : energies_) energy->add(group, x, own, step, scratch);
  }

  // Elastic energy in double, J; displacements per node of the organ.
  double energy_j(std::span<const Vec3f> displacements) const;
  std::size_t energy_count() const { return energies_.size(); }
  const Energy& energy(std::size_t i) const { return *energies_[i]; }

 private:
  Groups groups_;
  std::vector<std::unique_ptr<Energy>> energies_;
  bool follows_moves_ = false;
};

}  // namespace trocar::dynamics
