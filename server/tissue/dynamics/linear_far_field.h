#pragma once

// The far field of a solver, linear about poses that follow the tissue: nodes far from all tools
// are swept every step, but from step to step they move little against their neighbours, so their
// forces come from matrices (Linearisation) that are renewed group after group, each every
// FarPoses::kInterval steps. Energies of nodal strain, which couple nodes that are no neighbours,
// are asked as ever. Where neighbours have moved apart by more than kMaxSpread of their distance
// since, add() declines and the energies have to be asked.
//
// Damping is proportional to stiffness, with one time for the whole organ: that with which it takes
// from the mean node as much as the tissue's own dashpots.
//
// State between steps is the displacements and the world's FarPoses: what a group is linear about
// is a function of these. One writer; the functions over a group may be called by several workers,
// each with its own groups.

#include <vector>

#include "server/tissue/dynamics/linearisation.h"
#include "server/tissue/world/world.h"

namespace trocar::dynamics {

class LinearFarField {
 public:
  // Largest relative motion of neighbours, over the root mean square of a node's edges at rest,
  // that is taken to be linear. Errors are of its square: what turns by that much is strained by
  // half the square, 2e-4, for no reason, which a thin wall resists much more than its bending.
  static constexpr float kMaxSpread = 0.02f;

  // Measures the edges at rest; read_state() must follow. The tissue must outlive it.
  LinearFarField(Tissue& tissue, const world::World& world);

  // Displacements, per slot, are new everywhere.
  void read_state(const Float4* x, const world::World& world);

  // The tissue has followed an edit of the topology, with displacements per slot; world.far_poses
  // has its new nodes.
  void update_topology(const Float4* x, const world::World& world);

  // Before a step, in this order: begin_step(); renew() for groups that are due; begin_group() for
  // those with a node that moves, with displacements where sweeping starts and at the start of the
  // group's own step, 1/inverse_dt long.
  void begin_step(const Float4* x, world::World& world);
  bool is_due(Group group) const { return taken_at_[group] != pose_of(group); }
  void renew(Group group, Linearisation::Scratch& scratch);
  void begin_group(Group group, const Float4* x, const Float4* start, float inverse_dt);

  // Adds elastic gradient, damping and block; false, and nothing is added, where one of these lanes
  // has left the range.
  [[gnu::always_inline]] inline bool add(Group group, std::uint8_t lanes, float inverse_dt,
                                         NodeStep8& step) const;
  // Nodes of the group, or of these slots, have moved by dx, in whatever sweep.
  void after_move(Group group, const Vec8& dx, float inverse_dt);

  void after_move(const SlotLanes& slots, std::uint8_t lanes, const Vec8& dx, float inverse_dt);

  float damping_time_s() const { return damping_time_s_; }

 private:
  // Number of the pose that the group is to be linear about. Groups go over one after another.
  std::uint32_t pose_of(Group group) const {
    return group % world::FarPoses::kInterval <= age_ ? newest_ : newest_ - 1;
  }
  void copy_pose(std::uint32_t number, const world::World& world);
  void measure_edges(Group group, const world::World& world);

  const Tissue& tissue_;
  Linearisation linear_;
  std::vector<Lanes> inverse_square_edges_;   // 1/m^2, per group
  std::array<std::vector<Float4>, 2> poses_;  // per slot
  std::array<std::vector<Float4>, 2> away_;   // from these, with what damping adds
  std::vector<std::uint32_t> taken_at_;       // per group: number of its pose
  std::uint32_t newest_ = 0, age_ = 0;
  float damping_time_s_ = 0;
};

inline bool LinearFarField::add(Group group, std::uint8_t lanes, float inverse_dt,
                                NodeStep8& step) const {
  const auto& away = away_[taken_at_[group] % 2];
  NodeStep8 linear{zero_vec8(), zero_sym_mat8()};
  const Float8 spread = linear_.add(group, away.data(), load_group(&away[group * kLanes]), linear) *
                        load(inverse_square_edges_[group]);
  const Float8 is_far = _mm256_cmp_ps(spread, all(kMaxSpread * kMaxSpread), _CMP_NLE_UQ);
  if (bits_of(is_far) & lanes) return false;
  // Damping is in what nodes are away.
  const Float8 factor = all(1 + damping_time_s_ * inverse_dt);
  step.gradient = step.gradient + linear.gradient;
  step.block.xx = fma8(linear.block.xx, factor, step.block.xx);
  step.block.xy = fma8(linear.block.xy, factor, step.block.xy);
  step.block.xz = fma8(linear.block.xz, factor, step.block.xz);
  step.block.yy = fma8(linear.block.yy, factor, step.block.yy);
  step.block.yz = fma8(linear.block.yz, factor, step.block.yz);
  step.block.zz = fma8(linear.block.zz, factor, step.block.zz);
  return true;
}

inline void LinearFarField::after_move(const SlotLanes& slots, std::uint8_t lanes, const Vec8& dx,
                                       float inverse_dt) {
  const Float8 factor = all(1 + damping_time_s_ * inverse_dt);
  for (auto& away : away_)
    scatter(away.data(), slots, fma8(dx, factor, gather(away.data(), slots)), lanes);
}

inline void LinearFarField::after_move(Group group, const Vec8& dx, float inverse_dt) {
  const Float8 factor = all(1 + damping_time_s_ * inverse_dt);
  for (auto& away : away_) {
    Float4* const values = &away[group * kLanes];
    store_group(values, fma8(dx, factor, load_group(values)));
  }
}

}  // namespace trocar::dynamics
