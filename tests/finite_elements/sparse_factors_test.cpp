// Sparse Cholesky factors: right, and without threads of the library's own.

#include "server/lab/finite_elements/sparse_factors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <iterator>
#include <vector>

namespace trocar::finite_elements {
namespace {

// Lower triangle of the seven-point Laplacian on a grid of side^3 points, zero beyond it.
SparseMatrix laplacian(int side) {
  std::vector<Eigen::Triplet<double>> entries;
  const int steps[] = {1, side, side * side};
  for (int k = 0; k < side; ++k)
    for (int j = 0; j < side; ++j)
      for (int i = 0; i < side; ++i) {
        const int at = i + side * (j + side * k), place[] = {i, j, k};
        entries.emplace_back(at, at, 6.0);
        for (int axis = 0; axis < 3; ++axis)
          if (place[axis] + 1 < side) entries.emplace_back(at + steps[axis], at, -1.0);
      }
  SparseMatrix matrix(side * side * side, side * side * side);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

// Threads that a library has started stay, one task each, so that this test comes first.
std::ptrdiff_t threads_of_this_process() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/task"), {});
}

TEST(SparseFactors, StartNoThreads) {
  const auto before = threads_of_this_process();
  const auto matrix = laplacian(16);
  SparseFactors factors;
  factors.analyze(matrix);
  ASSERT_TRUE(factors.factor(matrix));
  EXPECT_EQ(threads_of_this_process(), before);
}

double residual(const SparseMatrix& matrix, double shift, const Vector& x, const Vector& right) {
  return (matrix.selfadjointView<Eigen::Lower>() * x + shift * x - right).norm();
}

TEST(SparseFactors, SolvesWithAndWithoutAShift) {
  const auto matrix = laplacian(6);
  Vector right(matrix.rows());
  for (Eigen::Index i = 0; i < right.size(); ++i) right[i] = std::sin(static_cast<double>(i));
  SparseFactors factors;
  factors.analyze(matrix);
  for (const double shift : {0.0, 2.5, 0.0}) {
    ASSERT_TRUE(factors.factor(matrix, shift));
    EXPECT_LT(residual(matrix, shift, factors.solve(right), right), 1e-12 * right.norm());
  }
}

TEST(SparseFactors, RefuseAMatrixThatIsNotPositiveDefinite) {
  const auto matrix = laplacian(6);
  SparseFactors factors;
  factors.analyze(matrix);
  EXPECT_FALSE(factors.factor(matrix, -6.0));
  EXPECT_TRUE(factors.factor(matrix));
}

}  // namespace
}  // namespace trocar::finite_elements
