#pragma once

// Whether a symmetric matrix is positive definite, by Cholesky's method. Square roots only.

#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

namespace trocar {

// lower: rows of the lower triangle, n (n + 1) / 2 numbers. Every pivot must be above `tolerance`
// times its entry of the diagonal; numbers that are not finite are refused. O(n^3).
inline bool is_positive_definite(std::span<const double> lower, std::size_t n,
                                 double tolerance = 0) {
  std::vector<double> l(lower.begin(), lower.end());
  for (std::size_t i = 0; i < n; ++i) {
    double* row = l.data() + i * (i + 1) / 2;
    for (std::size_t j = 0; j <= i; ++j) {
      const double* other = l.data() + j * (j + 1) / 2;
      double sum = row[j];
      for (std::size_t k = 0; k < j; ++k) sum -= row[k] * other[k];
      if (j < i) {
        row[j] = sum / other[j];
        continue;
      }
      if (!(sum > 0) || !(sum > tolerance * row[i]) || !std::isfinite(sum)) return false;
      row[i] = std::sqrt(sum);
    }
  }
  return true;
}

}  // namespace trocar
