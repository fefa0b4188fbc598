#pragma once

// Laws Psi(I1) of hyperelastic tets, per lane: what Hyperelastic<Law> needs of one. Below I1 = 3 a
// law that is not linear is continued linearly with its slope at 3, in the live solver and in
// closed forms alike.

#include "server/dynamics/lanes.h"

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

}  // namespace trocar::dynamics
