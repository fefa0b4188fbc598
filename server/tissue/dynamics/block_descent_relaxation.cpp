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

// In sessions, where far nodes are swept roughly, near ones take turns, too.
void BlockDescent::end_relaxation(world::World& world, std::span<const NodeIndex> held) {
  auto* const relaxation = tissue_.relaxation();
  if (relaxation == nullptr) return;
  const bool in_turns = far_.node_count > 0 || has_far_solver_;
  relaxed_.clear();
  for (const auto g : near_.groups) relaxed_.add(g, near_.lanes[g]);
  for (const auto node : held) relaxed_.add(tissue_.groups(), node);
  relaxed_lanes_.clear();
  for (const auto g : relaxed_.groups) relaxed_lanes_.push_back({g, relaxed_.lanes[g]});
  relaxation->end_step(x_.data(), relaxed_lanes_, in_turns, world.relaxation, workers_);

  const auto is_turn_of = [&](Group group, std::uint32_t turns) {
    return dynamics::Relaxation::is_turn_of(group, turns, world.relaxation.step());
  };
  relaxed_.clear();
  for (const auto lanes : relaxed_lanes_)
    if (!in_turns || is_turn_of(lanes.group, relaxation->near_turns()))
      relaxed_.add(lanes.group, lanes.lanes);
  for (const auto g : all_groups_)
    if (is_turn_of(g, relaxation->far_turns())) relaxed_.add(g, 0xff);
  for_each_group(relaxed_.groups, [&](Group g) {
    tissue_.relaxed_stress()->refresh({g, relaxed_.lanes[g]}, x_.data(), world.relaxation);
  });
}

}  // namespace trocar::dynamics
