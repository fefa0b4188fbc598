#pragma once

// What measured tissue has forgotten of its stress (relaxation.h), as forces against it: along each
// edge of a tet that relaxes a load that is constant in a step, in N per m of the edge as it is. A
// quadratic energy; its blocks leave out what would make them smaller.

#include "server/dynamics/energy.h"
#include "server/dynamics/relaxation.h"

namespace trocar::dynamics {

class RelaxedStress final : public Energy {
 public:
  // The relaxation must outlive it.
  RelaxedStress(const Topology& topology, const Groups& groups, const Relaxation& relaxation);

  void add(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
           Scratch& scratch) const override;
  void linearise(Group group, const Float4* x, const Vec8& own, NodeStep8& step,
                 StiffnessSink& sink) const override;
  // Of the loads as they are: not stored energy.
  void add_energies_j(std::span<const Vec3d> displacements,
                      std::span<double> energies) const override;
  std::size_t rebuild(const Topology& topology, const Groups& groups,
                      std::span<const GroupLanes> lanes) override;

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
