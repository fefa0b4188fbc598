#pragma once

// What measured tissue has forgotten of its stress (relaxation.h), as forces on nodes: each edge of
// a tet that relaxes bears a load that is constant in a step, in N per m of the edge. They are
// taken where the tissue is at the start of a step, so that they are constant, too; among
// themselves they balance, in force and torque. O(tets at the nodes) a step.

#include "server/dynamics/lanes.h"
#include "server/dynamics/relaxation.h"

namespace trocar::dynamics {

class RelaxedStress {
 public:
  // The relaxation must outlive it.
  RelaxedStress(const Topology& topology, const Groups& groups, const Relaxation& relaxation);

  // On the group's nodes, N; x: displacements per slot.
  Vec8 forces(Group group, const Float4* x) const;
  // As energies follow edits, see Energy::rebuild().
  std::size_t rebuild(const Topology& topology, const Groups& groups,
                      std::span<const GroupLanes> lanes);

 private:
  // A tet seen from one of its nodes: the other three, the edges there, and where their loads are.
  struct Row {
    std::array<SlotLanes, 3> others, loads;
    std::array<Vec3Lanes, 3> edges;  // rest pose, m

    void pad(std::size_t lane, Slot own) {
      for (std::size_t k = 0; k < 3; ++k) {
        others[k].v[lane] = own;
        loads[k].v[lane] = Relaxation::kNoLoad;
      }
    }
  };

  std::size_t fill(const Topology& topology, const Groups& groups, GroupLanes lanes);

  const Relaxation& relaxation_;
  GroupRows<Row> rows_;
  std::array<std::vector<TetIndex>, kLanes> tets_;  // while rows are filled
};

}  // namespace trocar::dynamics
