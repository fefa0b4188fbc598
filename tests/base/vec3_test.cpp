#include "common/math/vec3.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace trocar {
namespace {

TEST(Vec3, CrossIsRightHandedAndOrthogonal) {
  EXPECT_EQ(cross(Vec3f{1, 0, 0}, Vec3f{0, 1, 0}), (Vec3f{0, 0, 1}));
  EXPECT_EQ(cross(Vec3f{0, 1, 0}, Vec3f{0, 0, 1}), (Vec3f{1, 0, 0}));
}

TEST(Vec3, NormalizedFallsBackWhereThereIsNoDirection) {
  EXPECT_EQ(normalized(Vec3f{0, 0, 0}, Vec3f{0, 1, 0}), (Vec3f{0, 1, 0}));
  EXPECT_NEAR(length(normalized(Vec3d{1, 2, 3}, {})), 1, 1e-15);
}

TEST(Vec3, FinitenessLooksAtEveryComponent) {
  const float inf = std::numeric_limits<float>::infinity();
  EXPECT_TRUE(is_finite(Vec3f{1, 2, 3}));
  EXPECT_FALSE(is_finite(Vec3f{inf, 0, 0}));
  EXPECT_FALSE(is_finite(Vec3f{0, -inf, 0}));
  EXPECT_FALSE(is_finite(Vec3f{0, 0, inf - inf}));
}

template <typename T>
SymMat3<T> random_positive_definite(std::mt19937& random, T ridge) {
  std::normal_distribution<T> normal;
  SymMat3<T> a;
  for (int i = 0; i < 3; ++i) a.add_outer({normal(random), normal(random), normal(random)}, T(1));
  a.add_identity(ridge);
  return a;
}

TEST(SolvePositiveDefinite, InvertsTheProduct) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 5000; ++i) {
    const auto a = random_positive_definite<double>(random, 0.1);
    const Vec3d x{normal(random), normal(random), normal(random)};
    EXPECT_NEAR(length(solve_positive_definite(a, a * x) - x), 0, 1e-9 * (1 + length(x)));
  }
}

TEST(SolvePositiveDefinite, TheSolutionDescends) {
  // Block descent needs this: a step along A^-1 f never points against f.
  std::mt19937 random(6);
  std::normal_distribution<float> normal;
  for (int i = 0; i < 5000; ++i) {
    const auto a = random_positive_definite<float>(random, 0.01f);
    const Vec3f f{normal(random), normal(random), normal(random)};
    EXPECT_GE(dot(solve_positive_definite(a, f), f), 0);
  }
}

TEST(SolvePositiveDefinite, IsLinearInTheRightHandSideAndScalesInversely) {
  std::mt19937 random(7);
  const auto a = random_positive_definite<double>(random, 0.5);
  SymMat3<double> twice = a;
  twice += a;
  const Vec3d b{1, -2, 3};
  const Vec3d x = solve_positive_definite(a, b);
  EXPECT_NEAR(length(solve_positive_definite(a, b * 2.0) - x * 2.0), 0, 1e-12);
  EXPECT_NEAR(length(solve_positive_definite(twice, b) - x / 2.0), 0, 1e-12);
}

TEST(SolvePositiveDefinite, ABrokenBlockMovesNothing) {
  const Vec3f b{1, 2, 3};
  const Vec3f zero{};
  EXPECT_EQ(solve_positive_definite(SymMat3f{}, b), zero) << "singular";
  EXPECT_EQ(solve_positive_definite(SymMat3f{-1, 0, 0, 1, 0, 1}, b), zero) << "negative";
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(solve_positive_definite(SymMat3f{nan, 0, 0, 1, 0, 1}, b), zero) << "not a number";
  const float large = 1e30f;
  EXPECT_EQ(solve_positive_definite(SymMat3f{large, 0, 0, large, 0, large}, b), zero) << "overflow";
}

TEST(SymMat3, OuterProductsAndIdentityAreWhatTheySay) {
  SymMat3<double> a;
  const Vec3d n{0.6, 0, 0.8};
  a.add_outer(n, 5);
  a.add_identity(2);
  const Vec3d v{1, 2, 3};
  EXPECT_NEAR(length(a * v - (n * (5 * dot(n, v)) + v * 2.0)), 0, 1e-12);
}

}  // namespace
}  // namespace trocar
