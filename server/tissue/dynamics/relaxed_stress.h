#pragma once

// RelaxedStress turns what has relaxed of the stress of measured tissue (relaxation.h) into forces
// on nodes: each edge of a tet that relaxes bears a load that is constant in a step, in N per m of
// the edge. Forces are taken where the tissue is between two steps, and are constant in the next;
// those of all nodes, taken at once, balance in force and torque. Where strain is averaged,
// smoothing domains have their part: F Q b with F as NodalStrain keeps it. (StrainScheme::Explicit
// takes that part with the stress of smoothing domains, once per step; it is not here, then.)
// O(tets and smoothing domains at the nodes) each time.

#include "server/tissue/dynamics/lanes.h"
#include "server/tissue/dynamics/relaxation.h"
#include "server/tissue/dynamics/strain_scheme.h"

namespace trocar::dynamics {

class RelaxedStress {
 public:
  // Groups, the relaxation and the smoothing domains, null if they have no part, must outlive it.
  RelaxedStress(const topology::Topology& topology, const Groups& groups,
                const Relaxation& relaxation, const NodalStrain* strain);

  // Computes the forces on these nodes anew, in the state too; x: displacements per slot. Different
  // groups may be refreshed at once.
  void refresh(GroupLanes lanes, const Float4* x, world::RelaxationState& state);
  // Returns the forces as they were taken last, N.
  Vec8 forces(Group group) const { return load(forces_[group]); }
  // No relaxed stress acts on this node until its forces are taken anew.
  void release(NodeIndex node, world::RelaxationState& state) {
    const Slot slot = groups_.slot_of(node);
    forces_[slot / kLanes].set(slot % kLanes, {});
    state.set_force(node, {});
  }
  // Takes the forces of all nodes from the state.
  void read_state(const world::RelaxationState& state);
  // Follows an edit as energies do, see Energy::rebuild().
  void rebuild(const topology::Topology& topology, const Groups& groups,
               std::span<const GroupLanes> lanes);

 private:
  // A tet seen from one of its nodes: the other three, and where the loads of the edges there are.
  // Rows are read once in a while and are long gone from the caches then, so they are short.
  struct Row {
    std::array<SlotLanes, 3> others;
    SlotLanes loads;

    void pad(std::size_t lane, Slot own) {
      for (auto& other : others) other.v[lane] = own;
      loads.v[lane] = Relaxation::kNoLoads;
    }
  };

  void fill(const topology::Topology& topology, const Groups& groups, GroupLanes lanes);

  Vec8 nodal_forces(Group group) const;
  Vec8 forces_at(Group group, const Float4* x) const;
  Vec3f force_at(Group group, std::size_t lane, const Float4* x) const;

  const Groups& groups_;
  const Relaxation& relaxation_;
  const NodalStrain* const nodal_strain_;
  std::vector<Float4> rest_;  // per slot: where its node rests, m
  GroupRows<Row> rows_;
  std::vector<Vec3Lanes> forces_;
  std::array<std::vector<TetIndex>, kLanes> tets_;  // while rows are filled
};

// A world that begins: its tissue has been where it is for long. Measured organs under tension.
void start_relaxed(const organ::Organ& organ, world::World& world,
                   StrainScheme scheme = StrainScheme::Implicit);

}  // namespace trocar::dynamics
