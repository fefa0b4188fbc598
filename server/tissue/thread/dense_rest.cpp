#include "server/tissue/thread/dense_rest.h"

#include <algorithm>

namespace trocar::thread {
namespace {

constexpr std::size_t kLanes = 4;

std::size_t stride_of(std::size_t rows) {
  return (rows + kLanes - 1) / kLanes * kLanes;
}

Column load(const double* p) {
  return reinterpret_cast<Column>(_mm256_loadu_pd(p));
}

}  // namespace

DenseRest::DenseRest(std::size_t most_nodes) : most_nodes_(most_nodes) {
  values_.reserve(3 * most_nodes * stride_of(3 * most_nodes));
  inverse_diagonal_.reserve(3 * most_nodes);
  solution_.reserve(3 * most_nodes);
}

void DenseRest::begin(std::size_t nodes) {
  size_ = 3 * nodes;
  stride_ = stride_of(size_);
  values_.assign(size_ * stride_, 0.0);
  inverse_diagonal_.resize(size_);
  solution_.resize(size_);
}

void DenseRest::add(std::size_t a, std::size_t b, const Block& block, double scale) {
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c) {
      const double value = block.at(r, c) * scale;
      if (a <= b)
        row(3 * a + r)[3 * b + c] += value;
      else
        row(3 * b + c)[3 * a + r] += value;
    }
}

// The three rows from `first` on among themselves.
void DenseRest::factor_rows(std::size_t first) {
  for (std::size_t k = first; k < first + 3; ++k) {
    double* const here = row(k);
    for (std::size_t q = first; q < k; ++q) {
      const double* const above = row(q);
      const double factor = above[k] * inverse_diagonal_[q];
      for (std::size_t j = k; j < size_; ++j) here[j] -= factor * above[j];
    }
    inverse_diagonal_[k] = 1 / here[k];
  }
}

void DenseRest::eliminate_below(std::size_t first) {
  const double *const r0 = row(first), *const r1 = row(first + 1), *const r2 = row(first + 2);
  const double* const d = &inverse_diagonal_[first];
  for (std::size_t i = first + 3; i < size_; ++i) {
    double* const here = row(i);
    const Column f0 = all_lanes(-r0[i] * d[0]), f1 = all_lanes(-r1[i] * d[1]),
                 f2 = all_lanes(-r2[i] * d[2]);
    for (std::size_t j = i / kLanes * kLanes; j < stride_; j += kLanes) {
      const Column sum =
          fused(f2, load(r2 + j), fused(f1, load(r1 + j), fused(f0, load(r0 + j), load(here + j))));
      _mm256_storeu_pd(here + j, reinterpret_cast<__m256d>(sum));
    }
  }
}

void DenseRest::solve(std::span<Column> right) {
  for (std::size_t k = 0; k < size_; k += 3) {
    factor_rows(k);
    eliminate_below(k);
  }
  auto& y = solution_;
  for (std::size_t k = 0; k < size_; ++k) y[k] = right[k / 3][k % 3];
  for (std::size_t k = 0; k < size_; ++k) {
    const double factor = y[k] * inverse_diagonal_[k];
    for (std::size_t j = k + 1; j < size_; ++j) y[j] -= row(k)[j] * factor;
  }
  for (std::size_t k = size_; k-- > 0;) {
    double sum = y[k];
    for (std::size_t j = k + 1; j < size_; ++j) sum -= row(k)[j] * y[j];
    y[k] = sum * inverse_diagonal_[k];
  }
  for (std::size_t a = 0; a < right.size(); ++a)
    right[a] = Column{y[3 * a], y[3 * a + 1], y[3 * a + 2], 0};
}

}  // namespace trocar::thread
