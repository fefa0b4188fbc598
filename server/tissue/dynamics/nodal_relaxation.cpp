#include "server/tissue/dynamics/nodal_relaxation.h"

namespace trocar::dynamics {

NodalRelaxation::NodalRelaxation(const topology::Topology& topology, const Groups& groups,
                                 const NodalStrain& strain, const RelaxationTerms& terms)
    : organ_(topology.organ()),
      nodal_strain_(strain),
      terms_(terms),
      block_of_(groups.slot_count(), kNoBlock),
      relaxed_(3 * groups.slot_count()) {
  for (std::uint32_t n = 0; n < topology.node_count(); ++n)
    set_lane(topology, groups, NodeIndex(n));
}

void NodalRelaxation::set_lane(const topology::Topology& topology, const Groups& groups,
                               NodeIndex node) {
  const std::size_t index = node.value / kLanes, lane = node.value % kLanes;
  if (index >= blocks_.size()) {
    blocks_.resize(index + 1);
    shares_.resize(index + 1);
  }
  Block& block = blocks_[index];
  block.relaxes.v[lane] = 0;
  block.places.v[lane] = 0;
  if (!topology.has_node(node)) return;
  const Slot slot = groups.slot_of(node);
  block_of_[slot] = static_cast<std::uint32_t>(index);
  block.places.v[lane] = 3 * slot;
  const auto material = nodal_strain_.material_of(node);
  if (material == NodalStrain::kNone) return;
  block.materials.set(lane, material);
  if (relaxes(organ::material_at(organ_, material))) block.relaxes.v[lane] = 1;
}

void NodalRelaxation::update(const topology::Topology& topology, const Groups& groups,
                             std::span<const GroupLanes> lanes) {
  block_of_.resize(groups.slot_count(), kNoBlock);
  relaxed_.resize(3 * groups.slot_count());
  const auto for_each_slot = [&](auto&& task) {
    for (const auto group_lanes : lanes)
      for (std::size_t lane = 0; lane < kLanes; ++lane)
        if (group_lanes.has(lane)) task(static_cast<Slot>(group_lanes.group * kLanes + lane));
  };
  // A slot that lost its node may have another: first what was there goes.
  for_each_slot([&](Slot slot) {
    if (const auto block = block_of_[slot]; block != kNoBlock)
      for (std::size_t lane = 0; lane < kLanes; ++lane)
        if (blocks_[block].places.v[lane] == 3 * slot) blocks_[block].relaxes.v[lane] = 0;
    block_of_[slot] = kNoBlock;
    for (std::size_t row = 0; row < 3; ++row) relaxed_[3 * slot + row] = {};
  });
  for_each_slot([&](Slot slot) {
    const auto node = groups.node_at(slot);
    if (!node.is_valid()) return;
    set_lane(topology, groups, node);
    stale_.push_back(node.value / kLanes);
  });
}

void NodalRelaxation::set_relaxed(const Block& block, const SymMat8& q) {
  const Float8 share = load(block.relaxes) * all(static_cast<float>(NodalStrain::kAveragedBracket));
  const std::array<Vec8, 3> rows{Vec8{q.xx, q.xy, q.xz}, Vec8{q.xy, q.yy, q.yz},
                                 Vec8{q.xz, q.yz, q.zz}};
  for (std::size_t r = 0; r < 3; ++r) {
    std::array<Float4, kLanes> values;
    store_group(values.data(), rows[r] * share);
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      if (block.relaxes.v[lane] != 0) relaxed_[block.places.v[lane] + r] = values[lane];
  }
}

RelaxationTerms::Response NodalRelaxation::response_of(const Block& block,
                                                       const RelaxationTerms::Constants& c,
                                                       NodalStrain::Gradient& gradient) const {
  gradient = nodal_strain_.gradient_at(block.places);
  const auto& [r0, r1, r2] = gradient.rows;
  return RelaxationTerms::response_of(c, {r0.x, r1.x, r2.x}, {r0.y, r1.y, r2.y},
                                      {r0.z, r1.z, r2.z});
}

void NodalRelaxation::begin_block(std::size_t index, const world::StressHistory& history,
                                  RelaxationTerms::Constants& scratch) {
  const Block& block = blocks_[index];
  const auto& c = terms_.of(block.materials, history.last_span(index), scratch);
  set_relaxed(block, terms_.ahead(history.block(index), c));
}

std::uint64_t NodalRelaxation::end_block(std::size_t index, world::StressHistory& history,
                                         RelaxationTerms::Constants& scratch) {
  const Block& block = blocks_[index];
  const auto& c = terms_.of(block.materials, history.age(index), scratch);
  NodalStrain::Gradient gradient;
  const auto response = response_of(block, c, gradient);
  const SymMat8 relaxed = terms_.advance(history.block(index), response.stress, c);
  set_relaxed(block, relaxed);
  // No smoothing domain: 1/V is zero.
  Lanes inverse, relaxes = block.relaxes;
  store(inverse, gradient.inverse_volume);
  Lanes volumes;
  for (std::size_t lane = 0; lane < kLanes; ++lane)
    volumes.v[lane] = relaxes.v[lane] == 0 ? 0 : 1 / inverse.v[lane];
  const Float8 volume = load(volumes);
  const Float8 averaged = volume * all(static_cast<float>(NodalStrain::kAveragedBracket));
  const auto& s = response.stress;
  shares_[index] = {
      .energy_j = sum_of_lanes(fma8(response.bracket, averaged, response.bulk * volume)),
      .stress_squared = sum_of_lanes(product8(s, s) * averaged),
      .relaxed = sum_of_lanes(product8(s, relaxed) * averaged)};
  return history.advanced(index);
}

std::uint64_t NodalRelaxation::settle_block(std::size_t index, world::StressHistory& history,
                                            RelaxationTerms::Constants& scratch) const {
  const Block& block = blocks_[index];
  NodalStrain::Gradient gradient;
  const auto response = response_of(block, terms_.of(block.materials, {}, scratch), gradient);
  terms_.settle(history.block(index), response.stress, block.materials);
  return history.advanced(index);
}

}  // namespace trocar::dynamics
