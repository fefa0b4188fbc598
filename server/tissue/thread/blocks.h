#pragma once

// Blocks of 3 x 3 in double, for the matrix of a thread: a column is one AVX2 register whose last
// lane is zero. Every operation is one IEEE rounding per lane; multiplications and additions are
// fused here and nowhere else, so results depend on neither compiler nor build.

#include <immintrin.h>

#include "common/math/vec3.h"

namespace trocar::thread {

using Column = double __attribute__((vector_size(32)));

inline Column all_lanes(double s) {
  return Column{s, s, s, s};
}
inline Column to_column(const Vec3d& a) {
  return Column{a.x, a.y, a.z, 0};
}
inline Vec3d to_vec3(Column a) {
  return {a[0], a[1], a[2]};
}
// a * b + c, rounded once.
inline Column fused(Column a, Column b, Column c) {
  return reinterpret_cast<Column>(_mm256_fmadd_pd(
      reinterpret_cast<__m256d>(a), reinterpret_cast<__m256d>(b), reinterpret_cast<__m256d>(c)));
}
template <int kLane>
Column lane_of(Column a) {
  return reinterpret_cast<Column>(
      _mm256_permute4x64_pd(reinterpret_cast<__m256d>(a), kLane * 0x55));
}

struct Block {
  Column columns[3] = {};

  double at(std::size_t row, std::size_t column) const { return columns[column][row]; }
  Block& operator+=(const Block& b) {
    for (std::size_t k = 0; k < 3; ++k) columns[k] += b.columns[k];
    return *this;
  }
  Block& operator-=(const Block& b) {
    for (std::size_t k = 0; k < 3; ++k) columns[k] -= b.columns[k];
    return *this;
  }
  void add_identity(double s) { columns[0][0] += s, columns[1][1] += s, columns[2][2] += s; }
  // Subtracts s times b.
  void subtract(Column s, const Block& b) {
    for (std::size_t k = 0; k < 3; ++k) columns[k] -= s * b.columns[k];
  }
};

inline Block operator*(const Block& a, double s) {
  const Column all = all_lanes(s);
  return {{a.columns[0] * all, a.columns[1] * all, a.columns[2] * all}};
}
inline Column operator*(const Block& a, Column b) {
  return fused(a.columns[2], lane_of<2>(b),
               fused(a.columns[1], lane_of<1>(b), a.columns[0] * lane_of<0>(b)));
}
inline Block operator*(const Block& a, const Block& b) {
  return {{a * b.columns[0], a * b.columns[1], a * b.columns[2]}};
}
// along n n^T + across (I - n n^T), n of length 1.
inline Block uniaxial(const Vec3d& n, double along, double across) {
  const Column a = to_column(n);
  const double s = along - across;
  Block block{{a * all_lanes(n.x * s), a * all_lanes(n.y * s), a * all_lanes(n.z * s)}};
  block.add_identity(across);
  return block;
}
inline Block transposed(const Block& a) {
  const auto& c = a.columns;
  return {{Column{c[0][0], c[1][0], c[2][0], 0}, Column{c[0][1], c[1][1], c[2][1], 0},
           Column{c[0][2], c[1][2], c[2][2], 0}}};
}
// The inverse of a symmetric positive definite block, by its adjugate: one division.
inline Block inverse(const Block& a) {
  const double p = a.at(0, 0), q = a.at(1, 0), r = a.at(2, 0);
  const double s = a.at(1, 1), t = a.at(2, 1), u = a.at(2, 2);
  const double xx = s * u - t * t, xy = r * t - q * u, xz = q * t - r * s;
  const double d = 1 / (p * xx + q * xy + r * xz);
  const double yy = (p * u - r * r) * d, yz = (q * r - p * t) * d, zz = (p * s - q * q) * d;
  return {
      {Column{xx * d, xy * d, xz * d, 0}, Column{xy * d, yy, yz, 0}, Column{xz * d, yz, zz, 0}}};
}

}  // namespace trocar::thread
