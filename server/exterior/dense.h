#pragma once

// Small dense algebra for a tick: rows of floats or doubles in multiples of eight, sums in one
// order whatever the compiler, no allocation.

#include <span>
#include <vector>

namespace trocar::exterior {

// Rounded up to a whole number of registers.
constexpr std::size_t padded(std::size_t count) {
  return (count + 7) / 8 * 8;
}

// A symmetric positive definite matrix, row by row with `stride` doubles, as U^T U.
class CholeskyFactor {
 public:
  explicit CholeskyFactor(std::size_t size = 0) { resize(size); }
  void resize(std::size_t size);
  std::size_t stride() const { return stride_; }
  // To be filled: the upper triangle.
  double* row(std::size_t i) { return upper_.data() + i * stride_; }
  // False: not positive definite.
  bool factor();
  void solve(std::span<double> x) const;

 private:
  std::size_t size_ = 0, stride_ = 0;
  std::vector<double> upper_;
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

}  // namespace trocar::exterior
