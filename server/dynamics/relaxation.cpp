#include "server/dynamics/relaxation.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"
#include "server/dynamics/psi.h"
#include "server/dynamics/tet_shape.h"

namespace trocar::dynamics {
namespace {

// A tet squeezed flatter than this has the stress of one that is as flat.
constexpr float kLeastVolumeRatio = 0.05f;
// Values of a block's tensors in the state.
constexpr std::size_t kTensor = world::RelaxationState::kComponents * kLanes;
static_assert(world::RelaxationState::kTets == kLanes);

// exp(-x), the same on every machine.
double decay_in(double x) {
  if (x > 700) return 0;
  int halvings = 0;
  for (; x > 0.1; ++halvings) x /= 2;
  double term = 1, sum = 1;
  for (int i = 1; i < 12; ++i) sum += term *= -x / i;
  for (; halvings > 0; --halvings) sum *= sum;
  return sum;
}

// (1 - exp(-x)) / x
double mean_decay_in(double x) {
  if (x > 0.1) return (1 - decay_in(x)) / x;
  double term = 1, sum = 1;
  for (int i = 2; i < 12; ++i) sum += term *= -x / i;
  return sum;
}

SymMat8 load_tensor(const float* values) {
  const auto at = [&](std::size_t i) { return _mm256_loadu_ps(values + i * kLanes); };
  return {at(0), at(1), at(2), at(3), at(4), at(5)};
}
void store_tensor(float* values, const SymMat8& m) {
  const Float8 components[] = {m.xx, m.xy, m.xz, m.yy, m.yz, m.zz};
  for (std::size_t i = 0; i < 6; ++i) _mm256_storeu_ps(values + i * kLanes, components[i]);
}
SymMat8 fma_tensor(const SymMat8& a, Float8 s, const SymMat8& b) {
  return {fma8(a.xx, s, b.xx), fma8(a.xy, s, b.xy), fma8(a.xz, s, b.xz),
          fma8(a.yy, s, b.yy), fma8(a.yz, s, b.yz), fma8(a.zz, s, b.zz)};
}
Vec8 times(const SymMat8& m, const Vec8& v) {
  return {fma8(m.xz, v.z, fma8(m.xy, v.y, m.xx * v.x)),
          fma8(m.yz, v.z, fma8(m.yy, v.y, m.xy * v.x)),
          fma8(m.zz, v.z, fma8(m.yz, v.y, m.xz * v.x))};
}

float sum(const Float8& values) {
  Lanes lanes;
  store(lanes, values);
  float total = 0;
  for (const float v : lanes.v) total += v;
  return total;
}

}  // namespace

bool relaxes(const scene::Material& material) {
  return material.elastic_law == scene::ElasticLaw::Measured &&
         !material.measured.relaxation.empty();
}

bool Relaxation::is_needed(const scene::Organ& organ) {
  return world::RelaxationState::terms_of(organ) > 0;
}

Relaxation::Relaxation(const Topology& topology, const Groups& groups)
    : organ_(topology.organ()),
      terms_(world::RelaxationState::terms_of(topology.organ())),
      loads_(kBlockLoads) {
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t) set_lane(topology, groups, TetIndex(t));
  blocks_of_.resize(groups.slot_count());
  for (Slot slot = 0; slot < groups.slot_count(); ++slot) list_blocks_of(topology, groups, slot);
  due_.reserve(blocks_.size());
}

void Relaxation::list_blocks_of(const Topology& topology, const Groups& groups, Slot slot) {
  auto& list = blocks_of_[slot];
  list.clear();
  const auto node = groups.node_at(slot);
  if (!node.is_valid()) return;
  for (const auto tet : topology.tets_of(node))
    if (const auto block = tet.value / kLanes; std::ranges::find(list, block) == list.end())
      list.push_back(block);
}

std::uint32_t Relaxation::load_index(TetIndex tet, std::size_t corner, std::size_t other) {
  static constexpr std::uint32_t kEdge[4][4] = {
      {0, 0, 1, 2}, {0, 0, 3, 4}, {1, 3, 0, 5}, {2, 4, 5, 0}};
  const auto block = tet.value / kLanes + 1;
  return static_cast<std::uint32_t>(block * kBlockLoads) + kEdge[corner][other] * kLanes +
         tet.value % kLanes;
}

void Relaxation::set_lane(const Topology& topology, const Groups& groups, TetIndex tet) {
  const std::size_t index = tet.value / kLanes, lane = tet.value % kLanes;
  if (index >= blocks_.size()) {
    blocks_.resize(index + 1);
    figures_.resize(index + 1);
    loads_.resize((index + 2) * kBlockLoads);
    for (std::size_t i = 0; i < kLanes; ++i)
      for (std::size_t k = 0; k < 3; ++k)
        blocks_[index].rest[k].set(
            i, Vec3f{k == 0 ? 1.f : 0.f, k == 1 ? 1.f : 0.f, k == 2 ? 1.f : 0.f});
  }
  Block& block = blocks_[index];
  block.volume.v[lane] = 0;
  if (!topology.has_tet(tet)) return;
  const auto material = topology.material_of(tet);
  block.materials[lane] = material;
  block.is_uniform = std::ranges::all_of(block.materials,
                                         [&](std::uint16_t m) { return m == block.materials[0]; });
  const auto& corners = topology.tet(tet);
  const auto shape = stress_free_shape(topology, tet, corners);
  std::array<Vec3d, 3> columns{};
  for (std::size_t k = 1; k < 4; ++k) {
    const Vec3d edge = topology.rest()[corners[k].value] - topology.rest()[corners[0].value];
    const auto& g = shape.gradients[k];
    columns[0] += edge * g.x, columns[1] += edge * g.y, columns[2] += edge * g.z;
    block.gradients[k - 1].set(lane, to_float(g));
  }
  for (std::size_t k = 0; k < 3; ++k) block.rest[k].set(lane, to_float(columns[k]));
  for (std::size_t k = 0; k < 4; ++k) block.nodes[k].v[lane] = groups.slot_of(corners[k]);
  if (relaxes(scene::material_at(organ_, material)))
    block.volume.v[lane] = static_cast<float>(shape.volume);
}

void Relaxation::follow(const Topology& topology, const Groups& groups,
                        std::span<const GroupLanes> lanes) {
  tets_.clear();
  for (const auto group_lanes : lanes)
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const auto node = groups.nodes_of(group_lanes.group)[lane];
      if (!group_lanes.has(lane) || !node.is_valid()) continue;
      for (const auto tet : topology.tets_of(node)) tets_.push_back(tet);
    }
  std::ranges::sort(tets_);
  const auto doubles = std::ranges::unique(tets_);
  tets_.erase(doubles.begin(), doubles.end());
  for (const auto tet : tets_) {
    set_lane(topology, groups, tet);
    if (const auto block = tet.value / kLanes; stale_.empty() || stale_.back() != block)
      stale_.push_back(block);
  }
  blocks_of_.resize(groups.slot_count());
  for (const auto group_lanes : lanes)
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      if (group_lanes.has(lane))
        list_blocks_of(topology, groups, static_cast<Slot>(group_lanes.group * kLanes + lane));
}

Relaxation::Constants Relaxation::constants_of(const scene::Material& material,
                                               std::size_t steps) const {
  Constants c;
  c.terms.resize(terms_);
  if (material.elastic_law != scene::ElasticLaw::Measured) return c;
  const auto fill = [](Lanes& lanes, double value) {
    std::ranges::fill(lanes.v, static_cast<float>(value));
  };
  const auto& law = material.measured;
  fill(c.two_c10, 2 * law.coefficients_pa[0]);
  fill(c.bulk, law.bulk_modulus_pa);
  c.is_exponential = law.energy == scene::StrainEnergy::Exponential;
  if (c.is_exponential) fill(c.exponent, law.exponent);
  for (std::size_t k = 0; k < c.slopes.size(); ++k)
    fill(c.slopes[k],
         static_cast<double>(k + 2) * law.coefficients_pa[k + 1] / law.coefficients_pa[0]);
  for (std::size_t k = 0; k < law.relaxation.size(); ++k) {
    const auto& [weight, time_s] = law.relaxation[k];
    const double next = static_cast<double>(dt_) / time_s, x = static_cast<double>(steps) * next;
    const double decay = decay_in(x), mean = mean_decay_in(x);
    auto& term = c.terms[k];
    fill(term.decay, decay);
    fill(term.of_before, weight * (mean - decay));
    fill(term.of_now, weight * (1 - mean));
    fill(term.next_decay, decay_in(next));
    fill(term.ahead, weight * (1 - decay_in(next)));
  }
  return c;
}

void Relaxation::set_dt(float dt) {
  dt_ = dt;
  is_stale_ = true;
  const auto turns_in = [dt](float time_s) {
    std::uint32_t turns = 1;
    while (turns < kMostSteps / 2 && 2 * static_cast<float>(turns) * dt <= time_s) turns *= 2;
    return turns;
  };
  near_turns_ = turns_in(kNearTime_s);
  far_turns_ = turns_in(kFarTime_s);
  constants_.clear();
  for (std::size_t steps = 1; steps <= kMostSteps; ++steps)
    for (std::size_t i = 0; i <= organ_.regions.size(); ++i)
      constants_.push_back(
          constants_of(scene::material_at(organ_, static_cast<std::uint16_t>(i)), steps));
}

const Relaxation::Constants& Relaxation::constants_of(const Block& block,
                                                      const world::RelaxationState::Steps& age,
                                                      Constants& scratch) const {
  const auto of_lane = [&](std::size_t lane) -> const Constants& {
    const auto steps = std::clamp<std::size_t>(age[lane], 1, kMostSteps);
    return constants_[(steps - 1) * (organ_.regions.size() + 1) + block.materials[lane]];
  };
  if (block.is_uniform && std::ranges::all_of(age, [&](auto steps) { return steps == age[0]; }))
    return of_lane(0);
  scratch.terms.resize(terms_);
  scratch.is_exponential = false;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const Constants& own = of_lane(lane);
    scratch.is_exponential |= own.is_exponential;
    const auto copy = [lane](const Lanes& from, Lanes& to) { to.v[lane] = from.v[lane]; };
    copy(own.two_c10, scratch.two_c10);
    copy(own.bulk, scratch.bulk);
    copy(own.exponent, scratch.exponent);
    for (std::size_t k = 0; k < own.slopes.size(); ++k) copy(own.slopes[k], scratch.slopes[k]);
    for (std::size_t k = 0; k < terms_; ++k) {
      for (const auto member :
           {&Term::decay, &Term::of_before, &Term::of_now, &Term::next_decay, &Term::ahead})
        copy(own.terms[k].*member, scratch.terms[k].*member);
    }
  }
  return scratch;
}

// Second Piola-Kirchhoff stress of the bracket Psi(I1) - 2 C10 (J - 1), with F = (columns f) and K
// its cofactors (columns k):  S = 2 C10 [Psi'/C10 I - K^T K / J].
Relaxation::Response Relaxation::response_of(const Block& block, const Constants& c,
                                             const Float4* x) {
  const Vec8 own = gather(x, block.nodes[0]);
  Vec8 f0 = load(block.rest[0]), f1 = load(block.rest[1]), f2 = load(block.rest[2]);
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec8 u = gather(x, block.nodes[k + 1]) - own, g = load(block.gradients[k]);
    f0 = fma8(u, g.x, f0), f1 = fma8(u, g.y, f1), f2 = fma8(u, g.z, f2);
  }
  const Float8 i1 = dot8(f0, f0) + (dot8(f1, f1) + dot8(f2, f2));
  const Float8 e = _mm256_max_ps(i1 - all(3), all(0));
  // Psi'/C10, and Psi/C10 less e, in powers of e.
  Float8 first = all(0), psi = all(0);
  for (std::size_t k = c.slopes.size(); k-- > 0;) {
    const Float8 slope = load(c.slopes[k]);
    first = fma8(first, e, slope);
    psi = fma8(psi, e, slope * all(1 / static_cast<float>(k + 2)));
  }
  first = fma8(first, e, all(1));
  psi = fma8(psi * e, e, i1 - all(3));
  if (c.is_exponential) {
    const Float8 b = load(c.exponent), is_own = _mm256_cmp_ps(b, all(0), _CMP_GT_OQ);
    const Float8 be = b * e, within = _mm256_min_ps(be, all(ExponentialLaw::kMost));
    const Float8 growth = exp8(within);
    const Float8 own_psi = (growth - all(1) + (be - within) * growth) / b;
    first = _mm256_blendv_ps(first, growth, is_own);
    psi = _mm256_blendv_ps(psi, own_psi + (i1 - all(3) - e), is_own);
  }
  const Vec8 k0 = cross8(f1, f2), k1 = cross8(f2, f0), k2 = cross8(f0, f1);
  const Float8 j = dot8(f0, k0), volume_ratio = _mm256_max_ps(j, all(kLeastVolumeRatio));
  const Float8 two_c10 = load(c.two_c10), scale = two_c10 / volume_ratio;
  const auto entry = [&](const Vec8& a, const Vec8& b) { return all(0) - dot8(a, b) * scale; };
  SymMat8 s{entry(k0, k0), entry(k0, k1), entry(k0, k2),
            entry(k1, k1), entry(k1, k2), entry(k2, k2)};
  s.add_identity(two_c10 * first);
  const Float8 growth = j - all(1);
  return {s, fma8(growth, load(c.bulk) * all(0.5f) * growth - two_c10, two_c10 * all(0.5f) * psi),
          j};
}

void Relaxation::set_figures(std::size_t index, const Response& response,
                             const SymMat8& relaxed_stress) {
  const auto& s = response.stress;
  const auto product = [](const SymMat8& a, const SymMat8& b) {
    return fma8(a.xx, b.xx, fma8(a.yy, b.yy, a.zz * b.zz)) +
           fma8(a.xy, b.xy, fma8(a.xz, b.xz, a.yz * b.yz)) * all(2);
  };
  const Float8 volume = load(blocks_[index].volume);
  figures_[index] = {sum(response.energy_density * volume), sum(volume),
                     sum((response.volume_ratio - all(1)) * volume), sum(product(s, s) * volume),
                     sum(product(s, relaxed_stress) * volume)};
}

RelaxationFigures Relaxation::figures() const {
  double energy = 0, volume = 0, growth = 0, squared = 0, relaxed = 0;
  for (const auto& block : figures_) {
    energy += static_cast<double>(block.energy_j);
    volume += static_cast<double>(block.volume_m3);
    growth += static_cast<double>(block.growth_m3);
    squared += static_cast<double>(block.stress_squared);
    relaxed += static_cast<double>(block.relaxed);
  }
  return {energy, volume > 0 ? growth / volume : 0, squared > 0 ? relaxed / squared : 0};
}

// On an edge between a and b a stress Q pulls by V g_a . Q g_b.
void Relaxation::set_loads(const Block& block, std::size_t index, const SymMat8& relaxed_stress) {
  const Float8 volume = load(block.volume);
  const Vec8 b = load(block.gradients[0]), c = load(block.gradients[1]),
             d = load(block.gradients[2]);
  const Vec8 qb = times(relaxed_stress, b) * volume, qc = times(relaxed_stress, c) * volume,
             qd = times(relaxed_stress, d) * volume;
  const Float8 bc = dot8(b, qc), bd = dot8(b, qd), cd = dot8(c, qd);
  const Float8 ab = all(0) - (dot8(b, qb) + bc + bd), ac = all(0) - (dot8(c, qc) + bc + cd),
               ad = all(0) - (dot8(d, qd) + bd + cd);
  float* const out = &loads_[(index + 1) * kBlockLoads];
  const Float8 edges[] = {ab, ac, ad, bc, bd, cd};
  for (std::size_t i = 0; i < kEdges; ++i) _mm256_storeu_ps(out + i * kLanes, edges[i]);
}

void Relaxation::begin_block(std::size_t index, const world::RelaxationState& state,
                             Constants& scratch) {
  const Block& block = blocks_[index];
  const Constants& c = constants_of(block, {}, scratch);
  const float* const values = state.block(index).data();
  const SymMat8 stress = load_tensor(values);
  SymMat8 relaxed_stress = zero_sym_mat8();
  for (std::size_t k = 0; k < terms_; ++k) {
    relaxed_stress =
        fma_tensor(load_tensor(values + (k + 1) * kTensor), load(c.terms[k].next_decay),
                   fma_tensor(stress, load(c.terms[k].ahead), relaxed_stress));
  }
  set_loads(block, index, relaxed_stress);
}

std::uint64_t Relaxation::end_block(std::size_t index, const Float4* x,
                                    world::RelaxationState& state, Constants& scratch) {
  const Block& block = blocks_[index];
  const Constants& c = constants_of(block, state.age(index), scratch);
  float* const values = state.block(index).data();
  const Response response = response_of(block, c, x);
  const SymMat8 before = load_tensor(values), &now = response.stress;
  store_tensor(values, now);
  SymMat8 relaxed_stress = zero_sym_mat8();
  for (std::size_t k = 0; k < terms_; ++k) {
    const Term& term = c.terms[k];
    float* const own = values + (k + 1) * kTensor;
    const SymMat8 added = fma_tensor(before, load(term.of_before),
                                     fma_tensor(now, load(term.of_now), zero_sym_mat8()));
    const SymMat8 q = fma_tensor(load_tensor(own), load(term.decay), added);
    store_tensor(own, q);
    relaxed_stress =
        fma_tensor(q, load(term.next_decay), fma_tensor(now, load(term.ahead), relaxed_stress));
  }
  set_loads(block, index, relaxed_stress);
  set_figures(index, response, relaxed_stress);
  return state.advanced(index);
}

void Relaxation::settle(const Float4* x, world::RelaxationState& state) {
  Constants scratch;
  if (dt_ == 0) set_dt(1);
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const SymMat8 stress = response_of(blocks_[i], constants_of(blocks_[i], {}, scratch), x).stress;
    float* const values = state.block(i).data();
    store_tensor(values, stress);
    for (std::size_t k = 0; k < terms_; ++k) {
      Lanes weights;
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const auto& law = scene::material_at(organ_, blocks_[i].materials[lane]).measured;
        weights.v[lane] =
            k < law.relaxation.size() ? static_cast<float>(law.relaxation[k].weight) : 0;
      }
      store_tensor(values + (k + 1) * kTensor, fma_tensor(stress, load(weights), zero_sym_mat8()));
    }
    state.add_to_hash(state.advanced(i));
  }
  is_stale_ = true;
}

void Relaxation::refresh(const world::RelaxationState& state) {
  TROCAR_ASSERT(dt_ > 0);
  for (const auto block : stale_) begin_block(block, state, scratch_[0]);
  stale_.clear();
}

void Relaxation::begin_step(float dt, const world::RelaxationState& state, Workers& workers) {
  TROCAR_ASSERT(state.block_count() >= blocks_.size());
  if (dt != dt_) set_dt(dt);
  scratch_.resize(workers.count());
  differences_.resize(workers.count());
  if (!is_stale_) {
    refresh(state);
    return;
  }
  is_stale_ = false;
  stale_.clear();
  workers.run([&](unsigned w) {
    const auto n = blocks_.size(), count = std::size_t{workers.count()};
    for (auto i = n * w / count; i < n * (w + 1) / count; ++i) begin_block(i, state, scratch_[w]);
  });
}

void Relaxation::list_due(std::span<const GroupLanes> near, std::uint32_t near_turns,
                          std::uint8_t step) {
  due_.clear();
  due_stamp_.resize(blocks_.size());
  if (++current_ == 0) std::ranges::fill(due_stamp_, 0u), current_ = 1;
  const auto add = [&](std::uint32_t block) {
    if (due_stamp_[block] == current_) return;
    due_stamp_[block] = current_;
    due_.push_back(block);
  };
  for (const auto group_lanes : near)
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (!group_lanes.has(lane)) continue;
      for (const auto block : blocks_of_[group_lanes.group * kLanes + lane])
        if (is_turn_of(block, near_turns, step)) add(block);
    }
  const auto blocks = static_cast<std::uint32_t>(blocks_.size());
  for (auto run = step % far_turns_ * kRun; run < blocks; run += far_turns_ * kRun)
    for (auto i = run; i < std::min(run + kRun, blocks); ++i) add(i);
}

void Relaxation::end_step(const Float4* x, std::span<const GroupLanes> near, bool near_in_turns,
                          world::RelaxationState& state, Workers& workers) {
  state.begin_step();
  list_due(near, near_in_turns ? near_turns_ : 1, state.step());
  workers.run([&](unsigned w) {
    const auto n = due_.size(), count = std::size_t{workers.count()};
    std::uint64_t difference = 0;
    for (auto i = n * w / count; i < n * (w + 1) / count; ++i)
      difference += end_block(due_[i], x, state, scratch_[w]);
    differences_[w] = difference;
  });
  for (const auto difference : differences_) state.add_to_hash(difference);
}

}  // namespace trocar::dynamics
