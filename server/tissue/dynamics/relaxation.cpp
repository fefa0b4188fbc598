#include "server/tissue/dynamics/relaxation.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"
#include "common/base/tick.h"
#include "server/tissue/dynamics/psi.h"
#include "server/tissue/topology/tet_shape.h"

namespace trocar::dynamics {
namespace {

constexpr std::size_t kBlocksInARow = 4;  // of one worker: some microseconds

Vec8 times(const SymMat8& m, const Vec8& v) {
  return {fma8(m.xz, v.z, fma8(m.xy, v.y, m.xx * v.x)),
          fma8(m.yz, v.z, fma8(m.yy, v.y, m.xy * v.x)),
          fma8(m.zz, v.z, fma8(m.yz, v.y, m.xz * v.x))};
}

}  // namespace

bool Relaxation::is_needed(const organ::Organ& organ) {
  return world::RelaxationState::terms_of(organ) > 0;
}

Relaxation::Relaxation(const topology::Topology& topology, const Groups& groups,
                       const NodalStrain* strain, StrainScheme scheme)
    : organ_(topology.organ()),
      nodal_strain_(strain),
      terms_(organ_, RelaxationTerms::Use::InTurns),
      nodal_terms_(organ_, scheme == StrainScheme::Explicit ? RelaxationTerms::Use::UntilTurn
                                                            : RelaxationTerms::Use::InTurns),
      loads_(1) {
  if (world::RelaxationState::has_nodal(organ_))
    nodal_relaxation_ = std::make_unique<NodalRelaxation>(topology, groups, *strain, nodal_terms_);
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t) set_lane(topology, groups, TetIndex(t));
  blocks_of_.resize(groups.slot_count());
  for (Slot slot = 0; slot < groups.slot_count(); ++slot) list_blocks_of(topology, groups, slot);
  due_.reserve(blocks_.size());
}

void Relaxation::list_blocks_of(const topology::Topology& topology, const Groups& groups,
                                Slot slot) {
  auto& list = blocks_of_[slot];
  list.clear();
  const auto node = groups.node_at(slot);
  if (!node.is_valid()) return;
  for (const auto tet : topology.tets_of(node))
    if (const auto block = tet.value / kLanes; std::ranges::find(list, block) == list.end())
      list.push_back(block);
}

void Relaxation::set_lane(const topology::Topology& topology, const Groups& groups, TetIndex tet) {
  const std::size_t index = tet.value / kLanes, lane = tet.value % kLanes;
  if (index >= blocks_.size()) {
    blocks_.resize(index + 1);
    shares_.resize(index + 1);
    loads_.resize((index + 1) * kLanes + 1);
    for (std::size_t i = 0; i < kLanes; ++i)
      for (std::size_t k = 0; k < 3; ++k)
        blocks_[index].rest[k].set(
            i, Vec3f{k == 0 ? 1.f : 0.f, k == 1 ? 1.f : 0.f, k == 2 ? 1.f : 0.f});
  }
  Block& block = blocks_[index];
  block.volume.v[lane] = 0;
  if (!topology.has_tet(tet)) return;
  const auto material = topology.material_of(tet);
  block.materials.set(lane, material);
  const auto left =
      nodal_strain_ == nullptr ? NodalStrain::Left{} : nodal_strain_->left_to(topology, tet);
  block.bracket.v[lane] = static_cast<float>(left.bracket);
  block.volumetric.v[lane] = static_cast<float>(left.volumetric);
  const auto& corners = topology.tet(tet);
  const auto shape = topology::stress_free_shape(topology, tet, corners);
  std::array<Vec3d, 3> columns{};
  for (std::size_t k = 1; k < 4; ++k) {
    const Vec3d edge = topology.rest()[corners[k].value] - topology.rest()[corners[0].value];
    const auto& g = shape.gradients[k];
    columns[0] += edge * g.x, columns[1] += edge * g.y, columns[2] += edge * g.z;
    block.gradients[k - 1].set(lane, to_float(g));
  }
  for (std::size_t k = 0; k < 3; ++k) block.rest[k].set(lane, to_float(columns[k]));
  for (std::size_t k = 0; k < 4; ++k) block.nodes[k].v[lane] = groups.slot_of(corners[k]);
  if (relaxes(organ::material_at(organ_, material)))
    block.volume.v[lane] = static_cast<float>(shape.volume);
}

void Relaxation::update(const topology::Topology& topology, const Groups& groups,
                        std::span<const GroupLanes> lanes) {
  tets_.clear();
  for (const auto group_lanes : lanes)
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const auto node = groups.nodes_of(group_lanes.group)[lane];
      if (!group_lanes.has(lane) || !node.is_valid()) continue;
      for (const auto tet : topology.tets_of(node)) tets_.push_back(tet);
    }
  std::ranges::sort(tets_);
  tets_.erase(std::unique(tets_.begin(), tets_.end()), tets_.end());
  for (const auto tet : tets_) {
    set_lane(topology, groups, tet);
    if (const auto block = tet.value / kLanes; stale_.empty() || stale_.back() != block)
      stale_.push_back(block);
  }
  if (nodal_relaxation_) nodal_relaxation_->update(topology, groups, lanes);
  blocks_of_.resize(groups.slot_count());
  for (const auto group_lanes : lanes)
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      if (group_lanes.has(lane))
        list_blocks_of(topology, groups, static_cast<Slot>(group_lanes.group * kLanes + lane));
}

void Relaxation::set_dt(float dt) {
  is_stale_ = true;
  for (turns_ = 1;
       turns_ < RelaxationTerms::kMostSteps / 2 && 2 * static_cast<float>(turns_) * dt <= kTurn_s;)
    turns_ *= 2;
  terms_.set_dt(dt, turns_);
  nodal_terms_.set_dt(dt, turns_);
}

RelaxationTerms::Response Relaxation::response_of(const Block& block,
                                                  const RelaxationTerms::Constants& c,
                                                  const Float4* x) {
  const Vec8 own = gather(x, block.nodes[0]);
  Vec8 f0 = load(block.rest[0]), f1 = load(block.rest[1]), f2 = load(block.rest[2]);
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec8 u = gather(x, block.nodes[k + 1]) - own, g = load(block.gradients[k]);
    f0 = fma8(u, g.x, f0), f1 = fma8(u, g.y, f1), f2 = fma8(u, g.z, f2);
  }
  return RelaxationTerms::response_of(c, f0, f1, f2);
}

void Relaxation::set_shares(std::size_t index, const RelaxationTerms::Response& response,
                            const SymMat8& relaxed_stress) {
  const Block& block = blocks_[index];
  const auto& s = response.stress;
  const Float8 volume = load(block.volume), bracket = volume * load(block.bracket);
  shares_[index] = {sum_of_lanes(fma8(response.bracket, bracket,
                                      response.bulk * volume * load(block.volumetric))),
                    sum_of_lanes(volume), sum_of_lanes((response.volume_ratio - all(1)) * volume),
                    sum_of_lanes(product8(s, s) * bracket),
                    sum_of_lanes(product8(s, relaxed_stress) * bracket)};
}

RelaxationFigures Relaxation::figures() const {
  double energy = 0, volume = 0, growth = 0, squared = 0, relaxed = 0;
  const auto add = [&](std::span<const RelaxationShares> shares) {
    for (const auto& block : shares) {
      energy += static_cast<double>(block.energy_j);
      volume += static_cast<double>(block.volume_m3);
      growth += static_cast<double>(block.growth_m3);
      squared += static_cast<double>(block.stress_squared);
      relaxed += static_cast<double>(block.relaxed);
    }
  };
  add(shares_);
  if (nodal_relaxation_) add(nodal_relaxation_->shares());
  return {energy, volume > 0 ? growth / volume : 0, squared > 0 ? relaxed / squared : 0};
}

// On an edge between a and b a stress Q pulls by V g_a . Q g_b.
void Relaxation::set_loads(const Block& block, std::size_t index, const SymMat8& relaxed_stress) {
  const Float8 volume = load(block.volume) * load(block.bracket);
  const Vec8 b = load(block.gradients[0]), c = load(block.gradients[1]),
             d = load(block.gradients[2]);
  const Vec8 qb = times(relaxed_stress, b) * volume, qc = times(relaxed_stress, c) * volume,
             qd = times(relaxed_stress, d) * volume;
  const Float8 bc = dot8(b, qc), bd = dot8(b, qd), cd = dot8(c, qd);
  const Float8 ab = all(0) - (dot8(b, qb) + bc + bd), ac = all(0) - (dot8(c, qc) + bc + cd),
               ad = all(0) - (dot8(d, qd) + bd + cd);
  auto* const out = reinterpret_cast<Float4*>(&loads_[index * kLanes + 1]);
  store_strided(out, 2, {ab, ac, ad}, bc);
  store_strided(out + 1, 2, {bd, cd, all(0)}, all(0));
}

void Relaxation::begin_block(std::size_t index, const world::StressHistory& history,
                             RelaxationTerms::Constants& scratch) {
  const auto& c = terms_.of(blocks_[index].materials, history.last_span(index), scratch);
  set_loads(blocks_[index], index, terms_.ahead(history.block(index), c));
}

std::uint64_t Relaxation::end_block(std::size_t index, const Float4* x,
                                    world::StressHistory& history,
                                    RelaxationTerms::Constants& scratch) {
  const Block& block = blocks_[index];
  const auto& c = terms_.of(block.materials, history.age(index), scratch);
  const auto response = response_of(block, c, x);
  const SymMat8 relaxed = terms_.advance(history.block(index), response.stress, c);
  set_loads(block, index, relaxed);
  set_shares(index, response, relaxed);
  return history.advanced(index);
}

void Relaxation::settle(const Float4* x, world::RelaxationState& state) {
  RelaxationTerms::Constants scratch;
  if (terms_.dt() == 0) set_dt(1);
  auto& tets = state.tets();
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const auto& materials = blocks_[i].materials;
    const auto response = response_of(blocks_[i], terms_.of(materials, {}, scratch), x);
    terms_.settle(tets.block(i), response.stress, materials);
    tets.add_to_hash(tets.advanced(i));
  }
  for (std::size_t i = 0; nodal_relaxation_ && i < nodal_relaxation_->block_count(); ++i)
    state.nodal().add_to_hash(nodal_relaxation_->settle_block(i, state.nodal(), scratch));
  is_stale_ = true;
}

void Relaxation::begin_all(const world::RelaxationState& state, Workers& workers) {
  workers.for_each(blocks_.size(), kBlocksInARow,
                   [&](std::size_t i, unsigned w) { begin_block(i, state.tets(), scratch_[w]); });
  if (nodal_relaxation_)
    workers.for_each(nodal_relaxation_->block_count(), kBlocksInARow,
                     [&](std::size_t i, unsigned w) {
                       nodal_relaxation_->begin_block(i, state.nodal(), scratch_[w]);
                     });
}

void Relaxation::refresh(const world::RelaxationState& state) {
  if (is_stale_) {  // it was read while all slept, and no step has begun since
    if (terms_.dt() == 0) set_dt(kTickSeconds);
    scratch_.resize(std::max<std::size_t>(scratch_.size(), 1));
    Workers alone(1);
    begin_all(state, alone);
    is_stale_ = false;
    stale_.clear();
    if (nodal_relaxation_) nodal_relaxation_->clear_stale();
    return;
  }
  for (const auto block : stale_) begin_block(block, state.tets(), scratch_[0]);
  stale_.clear();
  if (!nodal_relaxation_) return;
  for (const auto block : nodal_relaxation_->stale())
    nodal_relaxation_->begin_block(block, state.nodal(), scratch_[0]);
  nodal_relaxation_->clear_stale();
}

void Relaxation::begin_step(float dt, const world::RelaxationState& state, Workers& workers) {
  TROCAR_ASSERT(state.tets().block_count() >= blocks_.size());
  if (dt != terms_.dt()) set_dt(dt);
  scratch_.resize(workers.most());
  differences_.resize(workers.most());
  if (!is_stale_) {
    refresh(state);
    return;
  }
  is_stale_ = false;
  stale_.clear();
  if (nodal_relaxation_) nodal_relaxation_->clear_stale();
  begin_all(state, workers);
}

void Relaxation::list_due(std::span<const GroupLanes> nodes, std::uint8_t step) {
  due_.clear();
  const auto tets = static_cast<std::uint32_t>(blocks_.size());
  const auto all =
      tets + static_cast<std::uint32_t>(nodal_relaxation_ ? nodal_relaxation_->block_count() : 0);
  is_due_.resize(all);
  is_due_.begin();
  const auto add = [&](std::uint32_t block) {
    if (is_due_.insert(block)) due_.push_back(block);
  };
  for (const auto group_lanes : nodes)
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (!group_lanes.has(lane)) continue;
      const auto slot = static_cast<Slot>(group_lanes.group * kLanes + lane);
      for (const auto block : blocks_of_[slot]) add(block);
      if (!nodal_relaxation_) continue;
      if (const auto block = nodal_relaxation_->block_of(slot); block != NodalRelaxation::kNoBlock)
        add(tets + block);
    }
  for (auto run = step % turns_ * kRun; run < all; run += turns_ * kRun)
    for (auto i = run; i < std::min(run + kRun, all); ++i) add(i);
}

void Relaxation::end_step(const Float4* x, std::span<const GroupLanes> nodes,
                          world::RelaxationState& state, Workers& workers) {
  state.begin_step();
  list_due(nodes, state.step());
  std::ranges::fill(differences_, std::array<std::uint64_t, 2>{});
  workers.for_each(due_.size(), kBlocksInARow, [&](std::size_t i, unsigned w) {
    auto& [of_tets, nodal] = differences_[w];
    if (due_[i] < blocks_.size())
      of_tets += end_block(due_[i], x, state.tets(), scratch_[w]);
    else
      nodal += nodal_relaxation_->end_block(due_[i] - blocks_.size(), state.nodal(), scratch_[w]);
  });
  for (const auto& [of_tets, nodal] : differences_) {
    state.tets().add_to_hash(of_tets);
    state.nodal().add_to_hash(nodal);
  }
}

}  // namespace trocar::dynamics
