#include "server/tissue/reduction/dense.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"

namespace trocar::reduction {
namespace {

constexpr std::size_t kPanel = 64;  // floats of a row in registers at once

float sum(__m256 a) {
  alignas(32) float v[8];
  _mm256_store_ps(v, a);
  return ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]));
}

// y += s x, of n doubles, a multiple of four.
void add_scaled(double s, const double* x, double* y, std::size_t n) {
  const __m256d factor = _mm256_set1_pd(s);
  for (std::size_t i = 0; i < n; i += 4)
    _mm256_storeu_pd(y + i,
                     _mm256_fmadd_pd(factor, _mm256_loadu_pd(x + i), _mm256_loadu_pd(y + i)));
}

double dot(const double* a, const double* b, std::size_t n) {
  __m256d even = _mm256_setzero_pd(), odd = even;
  std::size_t i = 0;
  for (; i + 8 <= n; i += 8) {
    even = _mm256_fmadd_pd(_mm256_loadu_pd(a + i), _mm256_loadu_pd(b + i), even);
    odd = _mm256_fmadd_pd(_mm256_loadu_pd(a + i + 4), _mm256_loadu_pd(b + i + 4), odd);
  }
  alignas(32) double v[4];
  _mm256_store_pd(v, _mm256_add_pd(even, odd));
  double rest = 0;
  for (; i < n; ++i) rest += a[i] * b[i];
  return ((v[0] + v[2]) + (v[1] + v[3])) + rest;
}

}  // namespace

void CholeskyFactor::resize(std::size_t size) {
  size_ = size;
  stride_ = padded(size);
  upper_.assign(size_ * stride_, 0);
}

bool CholeskyFactor::factor() {
  for (std::size_t k = 0; k < size_; ++k) {
    double* const pivot = row(k);
    if (!(pivot[k] > 0)) return false;
    const double inverse = 1 / std::sqrt(pivot[k]);
    for (std::size_t j = k; j < size_; ++j) pivot[j] *= inverse;
    for (std::size_t i = k + 1; i < size_; ++i) {
      const auto from = i / 4 * 4;  // what is left of the diagonal is not read
      add_scaled(-pivot[i], pivot + from, row(i) + from, stride_ - from);
    }
  }
  return true;
}

void CholeskyFactor::solve(std::span<double> x) const {
  for (std::size_t k = 0; k < size_; ++k) {
    const double* const r = upper_.data() + k * stride_;
    x[k] /= r[k];
    for (std::size_t j = k + 1; j < size_; ++j) x[j] -= r[j] * x[k];
  }
  for (std::size_t k = size_; k-- > 0;) {
    const double* const r = upper_.data() + k * stride_;
    x[k] = (x[k] - dot(r + k + 1, x.data() + k + 1, size_ - k - 1)) / r[k];
  }
}

void BlockSystem::resize(std::span<const std::size_t> begins) {
  begins_.assign(begins.begin(), begins.end());
  size_ = begins.back();
  stride_ = padded(size_);
  matrix_.assign(size_ * stride_, 0);
  factors_.resize(std::max(factors_.size(), begins.size() - 1));
  for (std::size_t b = 0; b + 1 < begins.size(); ++b) factors_[b].resize(begins[b + 1] - begins[b]);
}

void BlockSystem::add_link(const std::array<const float*, 3>& rows, const SymMat3f& b) {
  links_.push_back({rows, b});
  const auto& [x, y, z] = rows;
  for (std::size_t block = 0; block + 1 < begins_.size(); ++block)
    for (std::size_t i = begins_[block]; i < begins_[block + 1]; ++i) {
      const auto bx = static_cast<double>(b.xx * x[i] + b.xy * y[i] + b.xz * z[i]),
                 by = static_cast<double>(b.xy * x[i] + b.yy * y[i] + b.yz * z[i]),
                 bz = static_cast<double>(b.xz * x[i] + b.yz * y[i] + b.zz * z[i]);
      double* const r = row(i);
      const auto stop = begins_[block + 1];
      std::size_t j = i;
      const __m256d fx = _mm256_set1_pd(bx), fy = _mm256_set1_pd(by), fz = _mm256_set1_pd(bz);
      for (; j + 4 <= stop; j += 4) {
        __m256d sum = _mm256_loadu_pd(r + j);
        sum = _mm256_fmadd_pd(fx, _mm256_cvtps_pd(_mm_loadu_ps(x + j)), sum);
        sum = _mm256_fmadd_pd(fy, _mm256_cvtps_pd(_mm_loadu_ps(y + j)), sum);
        sum = _mm256_fmadd_pd(fz, _mm256_cvtps_pd(_mm_loadu_ps(z + j)), sum);
        _mm256_storeu_pd(r + j, sum);
      }
      for (; j < stop; ++j)
        r[j] += bx * static_cast<double>(x[j]) + by * static_cast<double>(y[j]) +
                bz * static_cast<double>(z[j]);
    }
}

bool BlockSystem::factor() {
  for (std::size_t b = 0; b + 1 < begins_.size(); ++b) {
    const auto first = begins_[b], count = begins_[b + 1] - first;
    for (std::size_t i = 0; i < count; ++i)
      std::copy_n(row(first + i) + first + i, count - i, factors_[b].row(i) + i);
    if (!factors_[b].factor()) return false;
  }
  return true;
}

// Solves for one block's x, with the other blocks' x as they stand (block Gauss-Seidel).
void BlockSystem::solve_block(std::size_t block, std::span<const double> right, std::span<double> x,
                              std::span<double> own) const {
  const auto first = begins_[block], end = begins_[block + 1];
  own = own.first(end - first);
  for (std::size_t i = first; i < end; ++i) {
    double left = right[i];
    const double* const r = matrix_.data() + i * stride_;
    for (std::size_t j = 0; j < first; ++j) left -= r[j] * x[j];
    for (std::size_t j = end; j < size_; ++j) left -= r[j] * x[j];
    own[i - first] = left;
  }
  for (const auto& [rows, b] : links_) {
    // The other blocks move the link by this.
    std::array<double, 3> d{};
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::size_t j = 0; j < first; ++j) d[k] += static_cast<double>(rows[k][j]) * x[j];
      for (std::size_t j = end; j < size_; ++j) d[k] += static_cast<double>(rows[k][j]) * x[j];
    }
    const Vec3f moved{static_cast<float>(d[0]), static_cast<float>(d[1]), static_cast<float>(d[2])};
    const Vec3f force = b * moved;
    for (std::size_t i = first; i < end; ++i)
      own[i - first] -=
          static_cast<double>(rows[0][i] * force.x + rows[1][i] * force.y + rows[2][i] * force.z);
  }
  factors_[block].solve(own);
  std::ranges::copy(own, x.begin() + static_cast<std::ptrdiff_t>(first));
}

void BlockSystem::solve(std::span<double> x, std::vector<double>& scratch, int passes) const {
  const auto blocks = begins_.size() - 1;
  if (blocks == 1) return factors_[0].solve(x);
  scratch.resize(2 * size_);
  const auto right = std::span(scratch).first(size_), own = std::span(scratch).last(size_);
  std::ranges::copy(x, right.begin());
  std::ranges::fill(x, 0.0);
  for (int pass = 0; pass < passes; ++pass) {
    for (std::size_t b = 0; b < blocks; ++b) solve_block(b, right, x, own);
    for (std::size_t b = blocks - 1; b-- > 0;) solve_block(b, right, x, own);
  }
}

void add_product(std::span<const double> a, std::size_t stride, std::span<const double> x,
                 std::span<double> y) {
  // Symmetric: its rows are its columns.
  for (std::size_t j = 0; j < x.size(); ++j)
    for (std::size_t i = 0; i < y.size(); ++i) y[i] += a[j * stride + i] * x[j];
}

void add_fields(const BasisRows& basis, std::span<const float> x, std::span<float> out) {
  TROCAR_ASSERT_HOT(x.size() == basis.stride);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const float* const row = basis.row(i);
    __m256 a = _mm256_setzero_ps(), b = a;
    std::size_t c = 0;
    for (; c + 16 <= basis.stride; c += 16) {
      a = _mm256_fmadd_ps(_mm256_loadu_ps(row + c), _mm256_loadu_ps(x.data() + c), a);
      b = _mm256_fmadd_ps(_mm256_loadu_ps(row + c + 8), _mm256_loadu_ps(x.data() + c + 8), b);
    }
    if (c < basis.stride)
      a = _mm256_fmadd_ps(_mm256_loadu_ps(row + c), _mm256_loadu_ps(x.data() + c), a);
    out[i] += sum(_mm256_add_ps(a, b));
  }
}

void add_along_fields(const BasisRows& basis, std::span<const float> f, std::span<float> out) {
  TROCAR_ASSERT_HOT(out.size() == basis.stride);
  for (std::size_t first = 0; first < basis.stride; first += kPanel) {
    const auto count = std::min(kPanel, basis.stride - first) / 8;
    __m256 sums[kPanel / 8];
    for (std::size_t k = 0; k < count; ++k) sums[k] = _mm256_loadu_ps(out.data() + first + 8 * k);
    for (std::size_t i = 0; i < f.size(); ++i) {
      if (f[i] == 0) continue;
      const __m256 factor = _mm256_set1_ps(f[i]);
      const float* const row = basis.row(i) + first;
      for (std::size_t k = 0; k < count; ++k)
        sums[k] = _mm256_fmadd_ps(factor, _mm256_loadu_ps(row + 8 * k), sums[k]);
    }
    for (std::size_t k = 0; k < count; ++k) _mm256_storeu_ps(out.data() + first + 8 * k, sums[k]);
  }
}

}  // namespace trocar::reduction
