// This file puts in place what external loads hold.

#include "server/tissue/dynamics/block_descent.h"

namespace trocar::dynamics {

void BlockDescent::place_held(const ExternalLoads& loads) {
  const auto& groups = tissue_.groups();
  for (std::size_t i = 0; i < loads.held.size(); ++i)
    x_[groups.slot_of(loads.held[i])] = to_float4(loads.held_displacements[i]);
  held_axes_.clear();
  if (loads.axis_holds.empty()) return;
  held_axes_.resize(groups.slot_count());
  for (const auto& hold : loads.axis_holds) {
    const Slot slot = groups.slot_of(hold.node);
    held_axes_[slot] = hold.axes;
    if (hold.axes & 1) x_[slot].x = hold.displacement.x;
    if (hold.axes & 2) x_[slot].y = hold.displacement.y;
    if (hold.axes & 4) x_[slot].z = hold.displacement.z;
  }
}

// Along a held axis nothing pushes and nothing couples, so that the step has no part there.
void BlockDescent::hold_axes(Group group, NodeStep8& step) const {
  Vec3Lanes gradients;
  SymMat3Lanes blocks;
  store(gradients, step.gradient);
  store(blocks, step.block);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const auto axes = held_axes_[group * kLanes + lane];
    if (axes & 1) gradients.x.v[lane] = 0, blocks.xy.v[lane] = 0, blocks.xz.v[lane] = 0;
    if (axes & 2) gradients.y.v[lane] = 0, blocks.xy.v[lane] = 0, blocks.yz.v[lane] = 0;
    if (axes & 4) gradients.z.v[lane] = 0, blocks.xz.v[lane] = 0, blocks.yz.v[lane] = 0;
  }
  step.gradient = load(gradients);
  step.block = load(blocks);
}

}  // namespace trocar::dynamics
