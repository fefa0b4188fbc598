#pragma once

// The one interface of everything that resists deformation: per node, the gradient of an energy
// over the node's displacement and the 3x3 block of its second derivative, eight nodes at a time.
//
// Contract: gradients are exact derivatives of energy_j() (plus, in a step, of the damping's
// potential); blocks are symmetric, positive semi-definite and at least close to the second
// derivative; rows of padding contribute nothing. A change of topology is followed lane by lane,
// bit for bit as if built anew. Energies over a node's whole smoothing domain have an interface of
// their own, NodalStrainEnergy (nodal_hyperelastic.h).

#include <span>

#include "server/tissue/dynamics/groups.h"

namespace trocar::dynamics {

struct NodeStep8 {
  Vec8 gradient;  // N
  SymMat8 block;  // N/m
};

// Takes the second derivatives of a group's nodes with one other node per lane: d gradient / d
// other, N/m, to be summed where the same other node comes again. In lanes without one, others
// holds the lane's own slot.
class StiffnessSink {
 public:
  StiffnessSink() = default;
  StiffnessSink(const StiffnessSink&) = delete;
  StiffnessSink& operator=(const StiffnessSink&) = delete;
  virtual ~StiffnessSink() = default;
  virtual void add(const SlotLanes& others, const Mat8& stiffness) = 0;
};

class Energy {
 public:
  Energy() = default;
  Energy(const Energy&) = delete;
  Energy& operator=(const Energy&) = delete;
  virtual ~Energy() = default;

  // Once per step for every group or pack that will be swept: what stays constant in the step, from
  // the displacements at its start (per slot; own: of the group). inverse_dt: 1/dt of the group's
  // step, or 0 for no damping. Several workers at once, each with its own groups.
  virtual void begin_group(Group, const Float4* /*start*/, const Vec8& /*own*/,
                           float /*inverse_dt*/) {}

  // Lanes of a pack hold other slots; begin_group() is still to come.
  virtual void pack(const PackedLanes& pack) = 0;

  // Adds the group's or pack's gradients and blocks at displacements x (per slot). own: those of
  // the group.
  virtual void add(Group group, const Float4* x, const Vec8& own, NodeStep8& step) const = 0;

  // The elastic part (no damping) at displacements x: adds gradient and block as add() would, and
  // gives the derivatives over all other nodes, always in the same order.
  virtual void linearise(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
                         StiffnessSink& sink) const = 0;

  // Adds each node's share, per slot, in double from the same stored data, J; displacements per
  // slot. A node's share is a function of displacements alone, not of what shares its group.
  virtual void add_energies_j(std::span<const Vec3d> displacements,
                              std::span<double> energies) const = 0;

  // The topology has changed and the groups have followed: these lanes anew, ascending groups. They
  // are those with another node than before, with a node that has changed, and with a neighbour of
  // a node in a new slot; where strain is averaged also those with a neighbour of a node that has
  // changed. Returns rows written, counted per lane.
  virtual std::size_t rebuild(const topology::Topology& topology, const Groups& groups,
                              std::span<const GroupLanes> lanes) = 0;
};

}  // namespace trocar::dynamics
