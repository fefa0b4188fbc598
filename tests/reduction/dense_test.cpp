#include "server/tissue/reduction/dense.h"

#include <gtest/gtest.h>

#include <cmath>

namespace trocar::reduction {
namespace {

double wave(std::size_t i) {
  return std::sin(static_cast<double>(i * i % 1009) * 0.37 + static_cast<double>(i));
}

TEST(CholeskyFactor, SolvesWhatIsPositiveDefinite) {
  for (const std::size_t n : {1u, 2u, 7u, 8u, 37u, 64u}) {
    std::vector<double> b(n * n), a(n * n), x(n), right(n);
    for (std::size_t i = 0; i < b.size(); ++i) b[i] = wave(i + 1);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j) {
        for (std::size_t k = 0; k < n; ++k) a[i * n + j] += b[k * n + i] * b[k * n + j];
        if (i == j) a[i * n + j] += 0.1;
      }
    for (std::size_t i = 0; i < n; ++i) x[i] = wave(7 * i + 3);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j) right[i] += a[i * n + j] * x[j];
    CholeskyFactor factor(n);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = i; j < n; ++j) factor.row(i)[j] = a[i * n + j];
    ASSERT_TRUE(factor.factor());
    factor.solve(right);
    for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(right[i], x[i], 1e-9) << n;
  }
}

TEST(CholeskyFactor, SaysWhatIsNot) {
  CholeskyFactor factor(2);
  factor.row(0)[0] = 1, factor.row(0)[1] = 2, factor.row(1)[1] = 1;
  EXPECT_FALSE(factor.factor());
  factor.row(0)[0] = NAN, factor.row(0)[1] = 0, factor.row(1)[1] = 1;
  EXPECT_FALSE(factor.factor());
}

// Blocks of sizes that end anywhere, and a link across them, against the factor of the whole.
TEST(BlockSystem, ComesToTheWholeSolution) {
  constexpr std::size_t kSize = 21;
  const std::vector<std::size_t> begins{0, 7, 12, kSize};
  std::vector<float> row[3];
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t i = 0; i < kSize; ++i)
      row[k].push_back(static_cast<float>(wave(50 * k + 3 * i)));
  const SymMat3f link{2, 0.1f, 0.2f, 1, 0, 1.5f};
  BlockSystem system;
  system.resize(begins);
  CholeskyFactor whole(kSize);
  for (std::size_t i = 0; i < kSize; ++i)
    for (std::size_t j = 0; j < kSize; ++j) {
      const double value = i == j ? 4 : 0.2 * wave(i * j + i + j);
      system.row(i)[j] = value;
      const Vec3f at{row[0][j], row[1][j], row[2][j]};
      const Vec3f force = link * at;
      if (j >= i)
        whole.row(i)[j] = value + static_cast<double>(row[0][i] * force.x + row[1][i] * force.y +
                                                      row[2][i] * force.z);
    }
  system.add_link({row[0].data(), row[1].data(), row[2].data()}, link);
  ASSERT_TRUE(system.factor());
  ASSERT_TRUE(whole.factor());
  std::vector<double> x(kSize), expected(kSize);
  for (std::size_t i = 0; i < kSize; ++i) x[i] = expected[i] = wave(i + 5);
  whole.solve(expected);
  auto roughly = x;
  std::vector<double> scratch;
  system.solve(roughly, scratch);
  system.solve(x, scratch, 60);
  double rough_error = 0, size = 0;
  for (std::size_t i = 0; i < kSize; ++i) {
    EXPECT_NEAR(x[i], expected[i], 1e-5);
    rough_error += (roughly[i] - expected[i]) * (roughly[i] - expected[i]);
    size += expected[i] * expected[i];
  }
  EXPECT_LT(rough_error, 0.1 * size);
}

TEST(Fields, AreSummedAndTheirTransposeToo) {
  for (const std::size_t width : {8u, 16u, 24u, 72u, 136u}) {
    constexpr std::size_t kRows = 29;
    std::vector<float> basis(kRows * width), x(width), f(kRows);
    for (std::size_t i = 0; i < basis.size(); ++i) basis[i] = static_cast<float>(wave(i));
    for (std::size_t i = 0; i < width; ++i) x[i] = static_cast<float>(wave(i + 99));
    for (std::size_t i = 0; i < kRows; ++i) f[i] = i % 5 == 0 ? 0 : static_cast<float>(wave(3 * i));
    std::vector<float> out(kRows, 0.5f), along(width, 0.25f);
    add_fields({basis, width}, x, out);
    add_along_fields({basis, width}, f, along);
    for (std::size_t i = 0; i < kRows; ++i) {
      double expected = 0.5;
      for (std::size_t c = 0; c < width; ++c)
        expected += static_cast<double>(basis[i * width + c]) * static_cast<double>(x[c]);
      EXPECT_NEAR(out[i], expected, 1e-4);
    }
    for (std::size_t c = 0; c < width; ++c) {
      double expected = 0.25;
      for (std::size_t i = 0; i < kRows; ++i)
        expected += static_cast<double>(basis[i * width + c]) * static_cast<double>(f[i]);
      EXPECT_NEAR(along[c], expected, 1e-4);
    }
  }
}

}  // namespace
}  // namespace trocar::reduction
