#include "server/tissue/dynamics/linear_far_field.h"

#include "server/tissue/dynamics/room.h"

namespace trocar::dynamics {
namespace {

double sum(const std::vector<float>& values) {
  double total = 0;
  for (const float value : values) total += static_cast<double>(value);
  return total;
}

}  // namespace

LinearFarField::LinearFarField(Tissue& tissue, const world::World& world)
    : tissue_(tissue), linear_(tissue) {
  const auto group_count = tissue.groups().group_count(), slots = tissue.groups().slot_count();
  const double elastic = sum(tissue.traces_at_rest(0, false)),
               damped = sum(tissue.traces_at_rest(1, false));
  if (elastic > 0) damping_time_s_ = static_cast<float>((damped - elastic) / elastic);
  inverse_square_edges_.resize(group_count);
  taken_at_.resize(group_count);
  for (auto* values : {&poses_[0], &poses_[1], &away_[0], &away_[1]}) {
    values->reserve(with_room(slots));
    values->resize(slots);
  }
  for (Group g = 0; g < group_count; ++g) measure_edges(g, world);
}

void LinearFarField::measure_edges(Group group, const world::World& world) {
  const auto& groups = tissue_.groups();
  for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
    const auto slot = static_cast<Slot>(group * kLanes + lane);
    const auto node = groups.node_at(slot);
    float sum = 0, count = 0;
    linear_.for_each_neighbour(slot, [&](Slot other) {
      const auto end = groups.node_at(other);
      sum += length_squared(world.rest_positions[end.value] - world.rest_positions[node.value]);
      ++count;
    });
    inverse_square_edges_[group].v[lane] = sum > 0 ? count / sum : 0;
  }
}

void LinearFarField::copy_pose(std::uint32_t number, const world::World& world) {
  const auto pose = world.far_poses.pose(number);
  auto& copy = poses_[number % 2];
  for (Slot slot = 0; slot < copy.size(); ++slot)
    if (const auto node = tissue_.groups().node_at(slot); node.is_valid())
      copy[slot] = to_float4(world::displacement_of(pose[node.value]));
}

void LinearFarField::read_state(const Float4* x, const world::World& world) {
  newest_ = world.far_poses.newest();
  age_ = world.far_poses.age();
  for (const auto number : {newest_, newest_ - 1}) copy_pose(number, world);
  Linearisation::Scratch scratch;
  for (Group g = 0; g < linear_.group_count(); ++g) {
    renew(g, scratch);
    begin_group(g, x, x, 0);
  }
}

void LinearFarField::begin_step(const Float4* x, world::World& world) {
  const bool has_new = world.far_poses.begin_step(world.displacements);
  newest_ = world.far_poses.newest();
  age_ = world.far_poses.age();
  if (!has_new) return;
  copy_pose(newest_, world);
  for (Group g = 0; g < linear_.group_count(); ++g) begin_group(g, x, x, 0);
}

void LinearFarField::update_topology(const Float4* x, const world::World& world) {
  const auto& groups = tissue_.groups();
  const auto group_count = groups.group_count();
  inverse_square_edges_.resize(group_count);
  taken_at_.resize(group_count);
  for (auto* values : {&poses_[0], &poses_[1], &away_[0], &away_[1]})
    values->resize(groups.slot_count());
  for (const auto number : {newest_, newest_ - 1}) {
    const auto pose = world.far_poses.pose(number);
    auto& copy = poses_[number % 2];
    for (const auto lanes : tissue_.rebuilt())
      for (std::uint32_t lane = 0; lane < kLanes; ++lane) {
        const auto node = groups.nodes_of(lanes.group)[lane];
        copy[lanes.group * kLanes + lane] =
            node.is_valid() ? to_float4(world::displacement_of(pose[node.value])) : Float4{};
      }
  }
  for (const auto lanes : tissue_.rebuilt()) {
    taken_at_[lanes.group] = pose_of(lanes.group);
    linear_.index(lanes.group, poses_[taken_at_[lanes.group] % 2].data());
    measure_edges(lanes.group, world);
    begin_group(lanes.group, x, x, 0);
  }
  linear_.tidy();
}

void LinearFarField::renew(Group group, Linearisation::Scratch& scratch) {
  taken_at_[group] = pose_of(group);
  linear_.renew(group, poses_[taken_at_[group] % 2].data(), scratch);
}

void LinearFarField::begin_group(Group group, const Float4* x, const Float4* start,
                                 float inverse_dt) {
  const auto first = group * kLanes;
  const Vec8 now = load_group(x + first);
  const Vec8 damped = (now - load_group(start + first)) * all(damping_time_s_ * inverse_dt);
  for (std::size_t i = 0; i < 2; ++i)
    store_group(&away_[i][first], (now - load_group(&poses_[i][first])) + damped);
}

}  // namespace trocar::dynamics
