#include "server/dynamics/relaxation.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"
#include "common/scene/any_material.h"
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

std::size_t most_terms(const scene::Organ& organ) {
  return world::RelaxationState(organ).terms();
}

}  // namespace

bool relaxes(const scene::Material& material) {
  return material.elastic_law == scene::ElasticLaw::Measured &&
         !material.measured.relaxation.empty();
}

bool Relaxation::is_needed(const scene::Organ& organ) {
  return scene::any_material(organ, relaxes);
}

Relaxation::Relaxation(const Topology& topology, const Groups& groups)
    : organ_(topology.organ()), terms_(most_terms(topology.organ())), loads_(kBlockLoads) {
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t) set_lane(topology, groups, TetIndex(t));
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
    loads_.resize((index + 2) * kBlockLoads);
    for (std::size_t i = 0; i < kLanes; ++i)
      for (std::size_t k = 0; k < 3; ++k)
        blocks_[index].rest[k].set(
            i, Vec3f{k == 0 ? 1.f : 0.f, k == 1 ? 1.f : 0.f, k == 2 ? 1.f : 0.f});
  }
  Block& block = blocks_[index];
  stale_.push_back(static_cast<std::uint32_t>(index));
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
  for (const auto group_lanes : lanes)
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const auto node = groups.nodes_of(group_lanes.group)[lane];
      if (!group_lanes.has(lane) || !node.is_valid()) continue;
      for (const auto tet : topology.tets_of(node)) set_lane(topology, groups, tet);
    }
}

void Relaxation::set_dt(float dt) {
  dt_ = dt;
  is_stale_ = true;
  constants_.assign(organ_.regions.size() + 1, {});
  for (std::size_t i = 0; i < constants_.size(); ++i) {
    const auto& material = scene::material_at(organ_, static_cast<std::uint16_t>(i));
    auto& c = constants_[i];
    c.terms.resize(terms_);
    if (material.elastic_law != scene::ElasticLaw::Measured) continue;
    const auto fill = [](Lanes& lanes, double value) {
      std::ranges::fill(lanes.v, static_cast<float>(value));
    };
    const auto& law = material.measured;
    fill(c.two_c10, 2 * law.coefficients_pa[0]);
    for (std::size_t k = 0; k < c.slopes.size(); ++k)
      fill(c.slopes[k],
           static_cast<double>(k + 2) * law.coefficients_pa[k + 1] / law.coefficients_pa[0]);
    for (std::size_t k = 0; k < law.relaxation.size(); ++k) {
      const auto& [weight, time_s] = law.relaxation[k];
      const double x = static_cast<double>(dt) / time_s;
      const double decay = decay_in(x), b = 1 - mean_decay_in(x);
      fill(c.terms[k].decay, decay);
      fill(c.terms[k].of_before, weight * (mean_decay_in(x) - decay));
      fill(c.terms[k].of_now, weight * b);
      fill(c.terms[k].ahead, weight * (1 - decay));
    }
  }
}

const Relaxation::Constants& Relaxation::constants_of(const Block& block,
                                                      Constants& scratch) const {
  if (block.is_uniform) return constants_[block.materials[0]];
  scratch.terms.resize(terms_);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const Constants& own = constants_[block.materials[lane]];
    const auto copy = [lane](const Lanes& from, Lanes& to) { to.v[lane] = from.v[lane]; };
    copy(own.two_c10, scratch.two_c10);
    for (std::size_t k = 0; k < own.slopes.size(); ++k) copy(own.slopes[k], scratch.slopes[k]);
    for (std::size_t k = 0; k < terms_; ++k) {
      const Term& term = own.terms[k];
      copy(term.decay, scratch.terms[k].decay);
      copy(term.of_before, scratch.terms[k].of_before);
      copy(term.of_now, scratch.terms[k].of_now);
      copy(term.ahead, scratch.terms[k].ahead);
    }
  }
  return scratch;
}

// Second Piola-Kirchhoff stress of the bracket Psi(I1) - 2 C10 (J - 1), with F = (columns f) and K
// its cofactors (columns k):  S = 2 C10 [Psi'/C10 I - K^T K / J].
SymMat8 Relaxation::stress_of(const Block& block, const Constants& c, const Float4* x) {
  const Vec8 own = gather(x, block.nodes[0]);
  Vec8 f0 = load(block.rest[0]), f1 = load(block.rest[1]), f2 = load(block.rest[2]);
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec8 u = gather(x, block.nodes[k + 1]) - own, g = load(block.gradients[k]);
    f0 = fma8(u, g.x, f0), f1 = fma8(u, g.y, f1), f2 = fma8(u, g.z, f2);
  }
  const Float8 i1 = dot8(f0, f0) + (dot8(f1, f1) + dot8(f2, f2));
  const Float8 e = _mm256_max_ps(i1 - all(3), all(0));
  const Float8 first =
      fma8(fma8(fma8(fma8(load(c.slopes[3]), e, load(c.slopes[2])), e, load(c.slopes[1])), e,
                load(c.slopes[0])),
           e, all(1));
  const Vec8 k0 = cross8(f1, f2), k1 = cross8(f2, f0), k2 = cross8(f0, f1);
  const Float8 volume_ratio = _mm256_max_ps(dot8(f0, k0), all(kLeastVolumeRatio));
  const Float8 two_c10 = load(c.two_c10), scale = two_c10 / volume_ratio;
  const auto entry = [&](const Vec8& a, const Vec8& b) { return all(0) - dot8(a, b) * scale; };
  SymMat8 s{entry(k0, k0), entry(k0, k1), entry(k0, k2),
            entry(k1, k1), entry(k1, k2), entry(k2, k2)};
  s.add_identity(two_c10 * first);
  return s;
}

// On an edge between a and b a stress Q pulls by V g_a . Q g_b.
void Relaxation::set_loads(const Block& block, std::size_t index, const SymMat8& forgotten) {
  const Float8 volume = load(block.volume);
  const Vec8 b = load(block.gradients[0]), c = load(block.gradients[1]),
             d = load(block.gradients[2]);
  const Vec8 qb = times(forgotten, b) * volume, qc = times(forgotten, c) * volume,
             qd = times(forgotten, d) * volume;
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
  const Constants& c = constants_of(block, scratch);
  const float* const values = state.block(index).data();
  const SymMat8 stress = load_tensor(values);
  SymMat8 forgotten = zero_sym_mat8();
  for (std::size_t k = 0; k < terms_; ++k) {
    forgotten = fma_tensor(load_tensor(values + (k + 1) * kTensor), load(c.terms[k].decay),
                           fma_tensor(stress, load(c.terms[k].ahead), forgotten));
  }
  set_loads(block, index, forgotten);
}

void Relaxation::end_block(std::size_t index, const Float4* x, world::RelaxationState& state,
                           Constants& scratch) {
  const Block& block = blocks_[index];
  const Constants& c = constants_of(block, scratch);
  float* const values = state.block(index).data();
  const SymMat8 before = load_tensor(values), now = stress_of(block, c, x);
  store_tensor(values, now);
  SymMat8 forgotten = zero_sym_mat8();
  for (std::size_t k = 0; k < terms_; ++k) {
    const Term& term = c.terms[k];
    float* const own = values + (k + 1) * kTensor;
    const SymMat8 added = fma_tensor(before, load(term.of_before),
                                     fma_tensor(now, load(term.of_now), zero_sym_mat8()));
    const SymMat8 q = fma_tensor(load_tensor(own), load(term.decay), added);
    store_tensor(own, q);
    forgotten = fma_tensor(q, load(term.decay), fma_tensor(now, load(term.ahead), forgotten));
  }
  set_loads(block, index, forgotten);
}

void Relaxation::settle(const Float4* x, world::RelaxationState& state) {
  Constants scratch;
  if (dt_ == 0) set_dt(1);
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const SymMat8 stress = stress_of(blocks_[i], constants_of(blocks_[i], scratch), x);
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
  }
  is_stale_ = true;
}

void start_relaxed(const scene::Organ& organ, world::World& world) {
  if (!Relaxation::is_needed(organ)) return;
  const Topology topology(organ);
  const Groups groups(topology, Coupling::Elements);
  std::vector<Float4> x(groups.slot_count());
  for (Slot slot = 0; slot < x.size(); ++slot)
    if (const auto node = groups.node_at(slot); node.is_valid())
      x[slot] = to_float4(world.displacements[node.value]);
  Relaxation(topology, groups).settle(x.data(), world.relaxation);
}

void Relaxation::begin_step(float dt, const world::RelaxationState& state, Workers& workers) {
  TROCAR_ASSERT(state.block_count() >= blocks_.size());
  if (dt != dt_) set_dt(dt);
  scratch_.resize(workers.count());
  if (!is_stale_) {
    for (const auto block : stale_) begin_block(block, state, scratch_[0]);
    stale_.clear();
    return;
  }
  is_stale_ = false;
  stale_.clear();
  workers.run([&](unsigned w) {
    const auto n = blocks_.size(), count = std::size_t{workers.count()};
    for (auto i = n * w / count; i < n * (w + 1) / count; ++i) begin_block(i, state, scratch_[w]);
  });
}

void Relaxation::end_step(const Float4* x, world::RelaxationState& state, Workers& workers) {
  workers.run([&](unsigned w) {
    const auto n = blocks_.size(), count = std::size_t{workers.count()};
    for (auto i = n * w / count; i < n * (w + 1) / count; ++i) end_block(i, x, state, scratch_[w]);
  });
}

}  // namespace trocar::dynamics
