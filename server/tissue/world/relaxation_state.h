#pragma once

// Tissue remembers stresses that it has had (quasi-linear viscoelasticity, Dogan 2011 eq. 1 to 4):
// those of tets, of the stars of nodes where strain is averaged, and per node the force of what has
// relaxed, as of the step that took it last. Empty for organs of which nothing relaxes.

#include "common/base/index.h"
#include "server/organs/organ/organ.h"
#include "server/tissue/world/stress_history.h"

namespace trocar::world {

class RelaxationState {
 public:
  explicit RelaxationState(const organ::Organ& organ);

  // The most that a material of the organ has.
  static std::size_t terms_of(const organ::Organ& organ);
  // A material relaxes, and its strain is averaged.
  static bool has_stars(const organ::Organ& organ);

  bool is_empty() const { return tets_.is_empty(); }
  StressHistory& tets() { return tets_; }
  const StressHistory& tets() const { return tets_; }
  // Places are nodes; empty unless has_stars().
  StressHistory& stars() { return stars_; }
  const StressHistory& stars() const { return stars_; }

  // Counts a step.
  void begin_step() { tets_.begin_step(), stars_.begin_step(); }
  std::uint8_t step() const { return tets_.step(); }

  // N; of as many nodes as the world has.
  std::span<const Vec3f> forces() const { return forces_; }
  void set_force(NodeIndex node, const Vec3f& force) { forces_[node.value] = force; }

  // A new node, on which no force acts yet, beside or as a copy of this one.
  void add_node(NodeIndex parent);

  void visit_state(StateArchive& archive);

 private:
  StressHistory tets_, stars_;
  std::vector<Vec3f> forces_;
};

}  // namespace trocar::world
