#pragma once

// Laws Psi(I1) of hyperelastic tets, per lane: what Hyperelastic<Law> needs of one. Below I1 = 3 a
// law that is not linear is continued linearly with its slope at 3, in the live solver and in
// closed forms alike.

#include "server/tissue/dynamics/lanes.h"

namespace trocar::dynamics {

// Psi = C10 (I1 - 3). Its slope is constant, so tets need not evaluate I1 at all.
struct NeoHookeanLaw {
  static constexpr bool kIsLinear = true;
};

// Psi = sum_i C_i0 (I1 - 3)^i, i = 1..5 (Dogan 2011 eq. 5), in multiples of C10, which the tet has.
struct ReducedPolynomialLaw {
  static constexpr bool kIsLinear = false;
  std::array<float, 4> ratios{};  // C20 .. C50 over C10

  bool operator==(const ReducedPolynomialLaw&) const = default;

  // First and second derivative over C10 at e = I1 - 3.
  void derivatives(Float8 e, Float8& first, Float8& second) const {
    const Float8 is_curved = _mm256_cmp_ps(e, all(0), _CMP_GT_OQ);
    e = _mm256_max_ps(e, all(0));
    first = all(0), second = all(0);
    for (std::size_t i = 4; i-- > 0;) {
      const auto power = static_cast<float>(i + 2);  // of (I1 - 3) in this term
      first = fma8(first, e, all(power * ratios[i]));
      second = fma8(second, e, all(power * (power - 1) * ratios[i]));
    }
    first = fma8(first, e, all(1.0f));
    second = where(is_curved, second);
  }
  double energy(double e) const {
    if (e < 0) return e;
    double sum = 0;
    for (std::size_t i = 4; i-- > 0;) sum = (sum + static_cast<double>(ratios[i])) * e;
    return (sum + 1) * e;
  }
};

// exp(x), the same on every machine, to 2e-7; 0 <= x <= 80.
inline Float8 exp8(Float8 x) {
  // x = n ln 2 + r, |r| <= ln 2 / 2
  const Float8 n = _mm256_round_ps(x * all(1.44269504f), _MM_FROUND_TO_NEAREST_INT);
  const Float8 r = fnma8(n, all(-2.12194440e-4f), fnma8(n, all(0.693359375f), x));
  Float8 sum = all(1.0f / 720);
  for (const float term : {1.0f / 120, 1.0f / 24, 1.0f / 6, 0.5f, 1.0f, 1.0f})
    sum = fma8(sum, r, all(term));
  const __m256i power =
      _mm256_slli_epi32(_mm256_add_epi32(_mm256_cvtps_epi32(n), _mm256_set1_epi32(127)), 23);
  return sum * _mm256_castsi256_ps(power);
}

// Psi = C10 / b (exp(b e) - 1) (Fung's type; Demiray 1972). From b e = kMost on continued linearly:
// tissue that is turned inside out would else overflow.
struct ExponentialLaw {
  static constexpr bool kIsLinear = false;
  static constexpr float kMost = 20;
  float exponent = 0;  // b

  bool operator==(const ExponentialLaw&) const = default;

  void derivatives(Float8 e, Float8& first, Float8& second) const {
    const Float8 x = e * all(exponent);
    const Float8 is_curved = _mm256_and_ps(_mm256_cmp_ps(x, all(0), _CMP_GT_OQ),
                                           _mm256_cmp_ps(x, all(kMost), _CMP_LT_OQ));
    first = exp8(_mm256_min_ps(_mm256_max_ps(x, all(0)), all(kMost)));
    second = where(is_curved, first * all(exponent));
  }
  double energy(double e) const {
    const double b = static_cast<double>(exponent), x = b * e;
    if (x < 0) return e;
    const double within = x < static_cast<double>(kMost) ? x : static_cast<double>(kMost);
    // By halves: the series needs few terms where what it is of is small.
    double part = within / 1024, term = part, sum = part;
    for (int i = 2; i < 10; ++i) sum += term *= part / i;
    for (int i = 0; i < 10; ++i) sum = sum * (sum + 2);
    return (sum + (x - within) * (sum + 1)) / b;
  }
};

}  // namespace trocar::dynamics
