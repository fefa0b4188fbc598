#include "server/tissue/dynamics/relaxation_terms.h"

#include <algorithm>

#include "server/tissue/dynamics/psi.h"
#include "server/tissue/world/relaxation_state.h"

namespace trocar::dynamics {
namespace {

// A tet squeezed flatter than this has the stress of one that is as flat.
constexpr float kLeastVolumeRatio = 0.05f;
// Values of a block's tensors.
constexpr std::size_t kTensor = world::StressHistory::kComponents * kLanes;
static_assert(world::StressHistory::kPlaces == kLanes);

// Returns exp(-x), the same on every machine.
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
}  // namespace

bool relaxes(const material::Material& material) {
  return material.elastic_law == material::ElasticLaw::Measured &&
         !material.measured.relaxation.empty();
}

void LaneMaterials::set(std::size_t lane, std::uint16_t material) {
  of_lane[lane] = material;
  is_uniform = std::ranges::all_of(of_lane, [&](std::uint16_t m) { return m == of_lane[0]; });
}

float sum_of_lanes(const Float8& values) {
  Lanes lanes;
  store(lanes, values);
  float total = 0;
  for (const float v : lanes.v) total += v;
  return total;
}

Float8 product8(const SymMat8& a, const SymMat8& b) {
  return fma8(a.xx, b.xx, fma8(a.yy, b.yy, a.zz * b.zz)) +
         fma8(a.xy, b.xy, fma8(a.xz, b.xz, a.yz * b.yz)) * all(2);
}

RelaxationTerms::RelaxationTerms(const organ::Organ& organ, Use use)
    : organ_(organ), use_(use), terms_(world::RelaxationState::terms_of(organ)) {}

void RelaxationTerms::set_dt(float dt, std::uint32_t turns) {
  dt_ = dt;
  turns_ = turns;
  constants_.clear();
  for (std::size_t steps = 1; steps <= kMostSteps; ++steps)
    for (std::size_t i = 0; i <= organ_.regions.size(); ++i)
      constants_.push_back(
          constants_of(organ::material_at(organ_, static_cast<std::uint16_t>(i)), steps));
}

// A place that is advanced every n steps is used in the n steps after it, (n + 1)/2 later on
// average. Nodes that take it in turns of their own do so (n - 1)/2 steps later, and keep it.
double RelaxationTerms::steps_ahead(std::size_t steps) const {
  const auto n = static_cast<double>(std::min<std::size_t>(steps, turns_));
  return use_ == Use::InTurns ? n : (n + 1) / 2;
}

RelaxationTerms::Constants RelaxationTerms::constants_of(const material::Material& material,
                                                         std::size_t steps) const {
  Constants c;
  c.terms.resize(terms_);
  if (material.elastic_law != material::ElasticLaw::Measured) return c;
  const auto fill = [](Lanes& lanes, double value) {
    std::ranges::fill(lanes.v, static_cast<float>(value));
  };
  const auto& law = material.measured;
  fill(c.two_c10, 2 * law.coefficients_pa[0]);
  fill(c.bulk, law.bulk_modulus_pa);
  c.is_exponential = law.energy == material::StrainEnergy::Exponential;
  if (c.is_exponential) fill(c.exponent, law.exponent);
  for (std::size_t k = 0; k < c.slopes.size(); ++k)
    fill(c.slopes[k],
         static_cast<double>(k + 2) * law.coefficients_pa[k + 1] / law.coefficients_pa[0]);
  for (std::size_t k = 0; k < law.relaxation.size(); ++k) {
    const auto& [weight, time_s] = law.relaxation[k];
    const double step = static_cast<double>(dt_) / time_s, x = static_cast<double>(steps) * step;
    const double decay = decay_in(x), mean = mean_decay_in(x);
    const double next_decay = decay_in(steps_ahead(steps) * step);
    auto& term = c.terms[k];
    fill(term.decay, decay);
    fill(term.of_before, weight * (mean - decay));
    fill(term.of_now, weight * (1 - mean));
    fill(term.next_decay, next_decay);
    fill(term.ahead, weight * (1 - next_decay));
  }
  return c;
}

const RelaxationTerms::Constants& RelaxationTerms::of(const LaneMaterials& materials,
                                                      const Steps& span, Constants& scratch) const {
  const auto of_lane = [&](std::size_t lane) -> const Constants& {
    const auto steps = std::clamp<std::size_t>(span[lane], 1, kMostSteps);
    return constants_[(steps - 1) * (organ_.regions.size() + 1) + materials.of_lane[lane]];
  };
  if (materials.is_uniform &&
      std::ranges::all_of(span, [&](auto steps) { return steps == span[0]; }))
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
RelaxationTerms::Response RelaxationTerms::response_of(const Constants& c, const Vec8& f0,
                                                       const Vec8& f1, const Vec8& f2) {
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
  const Float8 c10 = two_c10 * all(0.5f);
  return {s, fma8(c10, psi, all(0) - growth * two_c10), load(c.bulk) * all(0.5f) * growth * growth,
          j};
}

SymMat8 RelaxationTerms::ahead(std::span<const float> block, const Constants& c) const {
  const SymMat8 stress = load_tensor(block.data());
  SymMat8 relaxed = zero_sym_mat8();
  for (std::size_t k = 0; k < terms_; ++k)
    relaxed = fma_tensor(load_tensor(&block[(k + 1) * kTensor]), load(c.terms[k].next_decay),
                         fma_tensor(stress, load(c.terms[k].ahead), relaxed));
  return relaxed;
}

SymMat8 RelaxationTerms::advance(std::span<float> block, const SymMat8& now,
                                 const Constants& c) const {
  const SymMat8 before = load_tensor(block.data());
  store_tensor(block.data(), now);
  SymMat8 relaxed = zero_sym_mat8();
  for (std::size_t k = 0; k < terms_; ++k) {
    const Term& term = c.terms[k];
    float* const own = &block[(k + 1) * kTensor];
    const SymMat8 added = fma_tensor(before, load(term.of_before),
                                     fma_tensor(now, load(term.of_now), zero_sym_mat8()));
    const SymMat8 q = fma_tensor(load_tensor(own), load(term.decay), added);
    store_tensor(own, q);
    relaxed = fma_tensor(q, load(term.next_decay), fma_tensor(now, load(term.ahead), relaxed));
  }
  return relaxed;
}

void RelaxationTerms::settle(std::span<float> block, const SymMat8& stress,
                             const LaneMaterials& materials) const {
  store_tensor(block.data(), stress);
  for (std::size_t k = 0; k < terms_; ++k) {
    Lanes weights;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const auto& law = organ::material_at(organ_, materials.of_lane[lane]).measured;
      weights.v[lane] =
          k < law.relaxation.size() ? static_cast<float>(law.relaxation[k].weight) : 0;
    }
    store_tensor(&block[(k + 1) * kTensor], fma_tensor(stress, load(weights), zero_sym_mat8()));
  }
}

}  // namespace trocar::dynamics
