#pragma once

// Principal values and directions of symmetric matrices, by Jacobi's rotations. Square roots only,
// so the same bits everywhere that decisions are made from them.

#include <algorithm>
#include <array>
#include <cmath>

#include "common/math/vec3.h"

namespace trocar {

struct Principal {
  double value = 0;
  Vec3d direction;  // of length 1
};

// All three, in no order. Relative error below 1e-12 of the largest for finite matrices.
inline std::array<Principal, 3> principals_of(const SymMat3<double>& matrix) {
  std::array<std::array<double, 3>, 3> a{{{matrix.xx, matrix.xy, matrix.xz},
                                          {matrix.xy, matrix.yy, matrix.yz},
                                          {matrix.xz, matrix.yz, matrix.zz}}};
  std::array<std::array<double, 3>, 3> v{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  constexpr int kRounds = 8;  // it converges quadratically
  for (int round = 0; round < kRounds; ++round)
    for (std::size_t p = 0; p < 2; ++p)
      for (std::size_t q = p + 1; q < 3; ++q) {
        if (a[p][q] == 0) continue;
        const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const double t =
            (theta < 0 ? -1.0 : 1.0) / (std::abs(theta) + std::sqrt(theta * theta + 1));
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        for (std::size_t k = 0; k < 3; ++k) {
          const double kp = a[k][p], kq = a[k][q];
          a[k][p] = c * kp - s * kq;
          a[k][q] = s * kp + c * kq;
        }
        for (std::size_t k = 0; k < 3; ++k) {
          const double pk = a[p][k], qk = a[q][k];
          a[p][k] = c * pk - s * qk;
          a[q][k] = s * pk + c * qk;
          const double kp = v[k][p], kq = v[k][q];
          v[k][p] = c * kp - s * kq;
          v[k][q] = s * kp + c * kq;
        }
      }
  const auto principal = [&](std::size_t i) {
    return Principal{a[i][i], {v[0][i], v[1][i], v[2][i]}};
  };
  return {principal(0), principal(1), principal(2)};
}

inline Principal largest_principal(const SymMat3<double>& matrix) {
  const auto principals = principals_of(matrix);
  return *std::ranges::max_element(principals, {}, &Principal::value);
}

// The nearest matrix without negative principal values.
inline SymMat3<double> positive_part(const SymMat3<double>& matrix) {
  SymMat3<double> sum;
  for (const auto& principal : principals_of(matrix))
    sum.add_outer(principal.direction, std::max(0.0, principal.value));
  return sum;
}

}  // namespace trocar
