#pragma once

// Small dense algebra for a tick: rows of floats or doubles in multiples of eight, sums in one
// order whatever the compiler, no allocation.

#include <array>
#include <span>
#include <vector>

#include "common/math/vec3.h"

namespace trocar::reduction {

// Rounded up to a whole number of registers.
constexpr std::size_t padded(std::size_t count) {
  return (count + 7) / 8 * 8;
}

// A symmetric positive definite matrix, row by row with `stride` doubles, as U^T U.
class CholeskyFactor {
 public:
  explicit CholeskyFactor(std::size_t size = 0) { resize(size); }
  void resize(std::size_t size);
  // To be filled: the upper triangle.
  double* row(std::size_t i) { return upper_.data() + i * stride_; }
  // Factors the matrix in place; returns false if it is not positive definite.
  bool factor();
  void solve(std::span<double> x) const;

 private:
  std::size_t size_ = 0, stride_ = 0;
  std::vector<double> upper_;
};

// A symmetric system by blocks that are positive definite: each is solved on its own, there and
// back, with what the others have given so far (block Gauss-Seidel). Exact for one block; blocks
// that have the same in them do no harm.
class BlockSystem {
 public:
  // begins: of each block, and the end.
  void resize(std::span<const std::size_t> begins);
  // To be filled: all of it, but of the blocks on the diagonal the upper triangles alone are read.
  double* row(std::size_t i) { return matrix_.data() + i * stride_; }
  // Then, until the next resize() or clear_links(): adds R^T B R, with R of three rows of floats,
  // which must outlive its use. O(sum of squares of blocks).
  void add_link(const std::array<const float*, 3>& rows, const SymMat3f& b);
  void clear_links() { links_.clear(); }
  // Factors all blocks; returns false if one is not positive definite.
  bool factor();
  // x in place of the right side. scratch: of no meaning, kept for its memory.
  void solve(std::span<double> x, std::vector<double>& scratch, int passes = 1) const;

 private:
  struct Link {
    std::array<const float*, 3> rows;
    SymMat3f b;
  };
  void solve_block(std::size_t block, std::span<const double> right, std::span<double> x,
                   std::span<double> own) const;

  std::size_t size_ = 0, stride_ = 0;
  std::vector<std::size_t> begins_;
  std::vector<double> matrix_;
  std::vector<CholeskyFactor> factors_;
  std::vector<Link> links_;
};

// y += A x, A symmetric and whole, of n rows with a stride.
void add_product(std::span<const double> a, std::size_t stride, std::span<const double> x,
                 std::span<double> y);

// Fields at some degrees of freedom: a row for each, `stride` floats, a multiple of eight.
struct BasisRows {
  std::span<const float> values;
  std::size_t stride = 0;

  const float* row(std::size_t i) const { return values.data() + i * stride; }
};
// out[i] += sum_c basis[i][c] x[c]; x of stride entries.
void add_fields(const BasisRows& basis, std::span<const float> x, std::span<float> out);
// out[c] += sum_i f[i] basis[i][c].
void add_along_fields(const BasisRows& basis, std::span<const float> f, std::span<float> out);

}  // namespace trocar::reduction
