// The solver of tissue that relaxes: what it keeps of stress from step to step.

#include "server/tissue/dynamics/block_descent.h"

namespace trocar::dynamics {

void BlockDescent::read_relaxation(const world::World& world) {
  if (tissue_.relaxation() == nullptr) return;
  tissue_.relaxation()->restart();
  tissue_.relaxed_stress()->read_state(world.relaxation);
}

void BlockDescent::refresh_relaxed_forces(world::World& world) {
  if (tissue_.relaxation() == nullptr) return;
  if (auto* const strain = tissue_.nodal_strain())
    for (const auto lanes : tissue_.rebuilt()) strain->restart_group(lanes.group, x_.data());
  tissue_.relaxation()->refresh(world.relaxation);
  for (const auto lanes : tissue_.rebuilt())
    tissue_.relaxed_stress()->refresh(lanes, x_.data(), world.relaxation);
}

// In sessions, where far nodes are swept roughly, near ones take turns as these do.
void BlockDescent::end_relaxation(world::World& world, std::span<const NodeIndex> held) {
  auto* const relaxation = tissue_.relaxation();
  if (relaxation == nullptr) return;
  relaxed_.clear();
  if (far_.node_count == 0)
    for (const auto g : near_.groups) relaxed_.add(g, near_.lanes[g]);
  for (const auto node : held) relaxed_.add(tissue_.groups(), node);
  relaxed_lanes_.clear();
  for (const auto g : relaxed_.groups) relaxed_lanes_.push_back({g, relaxed_.lanes[g]});
  relaxation->end_step(x_.data(), relaxed_lanes_, world.relaxation, workers_);

  for (const auto g : all_groups_)
    if (relaxation->is_turn_of(g, world.relaxation.step())) relaxed_.add(g, 0xff);
  for_each_group(relaxed_.groups, [&](Group g) {
    tissue_.relaxed_stress()->refresh({g, relaxed_.lanes[g]}, x_.data(), world.relaxation);
  });
  for (const auto node : springing_) tissue_.relaxed_stress()->release(node, world.relaxation);
}

}  // namespace trocar::dynamics
