#pragma once

// The energies of one organ, on its nodes' colours: what a solver or integrator asks for gradients.
//
// After an edit of the topology, between steps, update_topology() brings colours, groups and rows
// up to date in time that is proportional to what meets at the changed nodes. Results are bit for
// bit those of a tissue built anew from the changed organ with the colours of this one.

#include <memory>
#include <optional>
#include <vector>

#include "server/tissue/dynamics/energy.h"
#include "server/tissue/dynamics/nodal_hyperelastic.h"
#include "server/tissue/dynamics/relaxation.h"
#include "server/tissue/dynamics/relaxed_stress.h"
#include "server/tissue/dynamics/strain_scheme.h"
#include "server/tissue/dynamics/ties.h"

namespace trocar::dynamics {

// This report says what following a change has cost.
struct UpdateReport {
  std::size_t nodes_changed = 0;  // whose existence, place or elements have changed
  std::size_t nodes_moved = 0;    // to another slot
  std::size_t groups = 0;         // with lanes written
  std::size_t lanes = 0;          // written, by the energy that writes most
  std::size_t rows = 0;           // written, per lane, all energies together
};

class Tissue {
 public:
  explicit Tissue(const organ::Organ& organ, StrainScheme scheme = StrainScheme::Implicit);
  // colours: per place of a node, those of a tissue stored before; empty: greedy.
  explicit Tissue(const topology::Topology& topology, std::span<const Colour> colours = {},
                  StrainScheme scheme = StrainScheme::Implicit);

  const Groups& groups() const { return groups_; }
  // Returns the averaged strain, which must be told when nodes move; null: nothing is averaged.
  NodalStrain* nodal_strain() { return nodal_strain_.get(); }
  const NodalStrain* nodal_strain() const { return nodal_strain_.get(); }

  void begin_group(Group group, const Float4* start, float inverse_dt) {
    begin_group(group, start, load_group(start + group * kLanes), inverse_dt);
  }
  // Begins a group or pack; own: its displacements.
  void begin_group(Group group, const Float4* start, const Vec8& own, float inverse_dt);
  // Lanes of a pack hold other slots.
  void pack(const PackedLanes& pack);
  void add(Group group, const Float4* x, const Vec8& own, NodeStep8& step) const {
    add_elements(group, x, own, step);
    add_averaged(group, step);
  }
  // Adds all but the energies of nodal strain.
  void add_elements(Group group, const Float4* x, const Vec8& own, NodeStep8& step) const {
    for (const auto& energy : energies_) energy->add(group, x, own, step);
  }
  // Adds the energies of nodal strain alone.
  void add_averaged(Group group, NodeStep8& step) const {
    for (const auto& energy : averaged_) energy->add(group, step);
  }

  // StrainScheme::Explicit: keeps the stress of the group's smoothing domains at displacements x
  // per slot, less what has relaxed of it.
  void update_nodal_stress(Group group, const Float4* x);
  // The stress puts these on a group's nodes, in all smoothing domains that they are in.
  struct NodalForces {
    Vec8 gradient;     // N
    Float8 stiffness;  // N/m, at least the largest eigenvalue of a node's block
    Float8 drag;       // N/m, likewise of folded domains, with what their shape adds
  };
  NodalForces nodal_forces(Group group) const;

  // The elastic part at displacements x but for energies of nodal strain, see Energy::linearise().
  void linearise(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
                 StiffnessSink& sink) const {
    for (const auto& energy : energies_) energy->linearise(group, x, own, step, sink);
  }

  // Per slot, of the node's block of second derivatives with everything at rest, damping for steps
  // of this length included, energies of nodal strain if asked for; N/m.
  std::vector<float> traces_at_rest(float inverse_dt, bool has_averaged);

  // Follows topology.changed(). The topology is the one this tissue was made from, or another of
  // the same organ with the same edits.
  UpdateReport update_topology(const topology::Topology& topology);
  // Lanes whose node, or what meets at it, the last update_topology() found changed; ascending.
  std::span<const GroupLanes> touched() const { return touched_; }
  // Lanes that energies had to rebuild: with averaged strain also those with a neighbour of a node
  // that changed.
  std::span<const GroupLanes> rebuilt() const { return nodal_strain_ ? wide_ : touched_; }

  // These return the memory of stresses, and the forces of relaxed stress, which no energy has;
  // null where nothing relaxes.
  Relaxation* relaxation() { return relaxation_.get(); }
  RelaxedStress* relaxed_stress() { return relaxed_stress_.get(); }
  const RelaxedStress* relaxed_stress() const { return relaxed_stress_.get(); }
  std::optional<RelaxationFigures> relaxation_figures() const {
    return relaxation_ ? std::optional(relaxation_->figures()) : std::nullopt;
  }

  // Returns the ties, whose memory is state; null: the organ has none.
  Ties* ties() { return ties_; }
  // Whether a tie meets at a node of the group.
  bool has_ties(Group group) const { return ties_ != nullptr && ties_->act_on(group); }

  // Elastic energy in double, J; displacements per place of a node.
  double energy_j(std::span<const Vec3f> displacements) const;

 private:
  Groups groups_;
  std::unique_ptr<NodalStrain> nodal_strain_;  // null: nothing is averaged
  std::vector<std::unique_ptr<Energy>> energies_;
  std::vector<std::unique_ptr<NodalStrainEnergy>> averaged_;
  Ties* ties_ = nullptr;  // of energies_
  const StrainScheme scheme_;
  // Three per slot: rows of the stress, Pa; beside them stiffness and drag. Empty: Implicit.
  std::vector<Float4> nodal_stresses_;
  std::unique_ptr<Relaxation> relaxation_;
  std::unique_ptr<RelaxedStress> relaxed_stress_;

  template <typename Law>
  void add_hyperelastic(const topology::Topology& topology,
                        const HyperelasticParameters& parameters, const Law& law = {});
  template <typename Law>
  void add_measured(const topology::Topology& topology);
  void add_relaxation(const topology::Topology& topology);
  void resize_stresses();
  void touch(Slot slot);
  void list_touched(std::vector<GroupLanes>& out);

  std::vector<NodeIndex> changed_;          // ascending
  std::vector<std::uint8_t> lanes_;         // per group, while lanes are collected
  std::vector<Group> touched_groups_;       // of these
  std::vector<GroupLanes> touched_, wide_;  // wide: with neighbours of changed nodes
};

}  // namespace trocar::dynamics
