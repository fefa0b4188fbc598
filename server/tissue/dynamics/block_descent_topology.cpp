// This file makes the solver follow an edit of the topology.

#include "server/tissue/dynamics/block_descent.h"

namespace trocar::dynamics {

// Resizes arrays to the groups and slots that there are now; new entries are empty.
void BlockDescent::resize_arrays() {
  const auto& groups = tissue_.groups();
  const auto group_count = groups.group_count(), slot_count = groups.slot_count();
  while (all_groups_.size() < group_count)
    all_groups_.push_back(static_cast<Group>(all_groups_.size()));
  constants_.resize(group_count);
  inertia_.resize(group_count);
  squares_.resize(group_count);
  for (auto* lanes : {&free_, &cut_, &rejected_, &near_.lanes, &far_.lanes, &far_swept_.lanes,
                      &cut_swept_.lanes, &last_.lanes, &begun_.lanes, &relaxed_.lanes})
    lanes->resize(group_count);
  for (auto& band : bands_)
    for (auto* plan : {&band.nodes, &band.kept}) plan->lanes.resize(group_count);
  packs_.extend(groups);
  for (auto* stamps : {&begun_stamp_, &group_stamp_, &serial_stamp_, &asked_stamp_})
    stamps->resize(group_count);
  for (auto* values : {&x_, &v_, &start_}) values->resize(slot_count);
  slot_stamp_.resize(slot_count);
  squared_moves_.resize(group_count);
  has_energies_.resize(group_count);
  groups_with_energies_.reserve(group_count);
  first_link_.resize(slot_count);
}

UpdateReport BlockDescent::update_topology(const topology::Topology& topology,
                                           const world::World& world) {
  topology_ = &topology;
  const auto report = tissue_.update_topology(topology);
  const auto& groups = tissue_.groups();
  resize_arrays();
  is_cut_.resize(world.node_count());
  for (const auto node : topology.changed()) is_cut_[node.value] = 1;
  for (const auto lanes : tissue_.touched())
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (!lanes.has(lane)) continue;
      const auto g = lanes.group;
      const auto node = groups.nodes_of(g)[lane];
      const bool has_node = node.is_valid();
      const auto& material =
          organ::material_at(organ_, has_node ? topology.material_of(node) : std::uint16_t{0});
      const float mass = has_node ? world.masses[node.value] : 0;
      constants_[g].mass.v[lane] = mass;
      constants_[g].damping.v[lane] = mass * static_cast<float>(material.node_damping_per_s);
      const bool is_free = has_node && is_swept(node, world);
      const bool is_cut = has_node && is_cut_[node.value] == 1;
      free_[g] = static_cast<std::uint8_t>((free_[g] & ~(1u << lane)) | unsigned{is_free} << lane);
      cut_[g] = static_cast<std::uint8_t>((cut_[g] & ~(1u << lane)) | unsigned{is_cut} << lane);
      x_[g * kLanes + lane] = has_node ? to_float4(world.displacements[node.value]) : Float4{};
      v_[g * kLanes + lane] = has_node ? to_float4(world.velocities[node.value]) : Float4{};
    }
  for (const auto lanes : tissue_.rebuilt())
    for (std::uint32_t lane = 0; lane < kLanes; ++lane)
      if (lanes.has(lane)) packs_.remove(lanes.group * kLanes + lane);
  if (linear_far_field_) linear_far_field_->update_topology(x_.data(), world);
  due_.reserve(groups.group_count());
  return report;
}

}  // namespace trocar::dynamics
