// Modes by the method of snapshots against the singular values and vectors of the snapshots
// themselves, which Eigen computes without forming products.

#include "server/papers/dogan/karhunen_loeve.h"

#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <random>

namespace trocar::dogan {
namespace {

// Singular values fall by `decay` from one to the next.
Matrix snapshots(Eigen::Index rows, Eigen::Index columns, double decay) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const auto fill = [&](Eigen::Index n) {
    return Matrix::NullaryExpr(n, columns, [&] { return normal(random); });
  };
  const Matrix left = Eigen::JacobiSVD<Matrix>(fill(rows), Eigen::ComputeThinU).matrixU();
  const Matrix right = Eigen::JacobiSVD<Matrix>(fill(columns), Eigen::ComputeThinU).matrixU();
  Vector values(columns);
  for (Eigen::Index i = 0; i < columns; ++i)
    values[i] = 3 * std::pow(decay, static_cast<double>(i));
  return left * values.asDiagonal() * right.transpose();
}

double orthonormality(const Matrix& modes) {
  return (modes.transpose() * modes - Matrix::Identity(modes.cols(), modes.cols()))
      .cwiseAbs()
      .maxCoeff();
}

TEST(KarhunenLoeve, ModesAreTheLeftSingularVectorsOfTheSnapshots) {
  const Matrix q = snapshots(90, 12, 0.6);
  const auto found = karhunen_loeve(q, 12);
  const Eigen::JacobiSVD<Matrix> svd(q, Eigen::ComputeThinU);
  ASSERT_EQ(found.modes.cols(), 12);
  for (Eigen::Index i = 0; i < 12; ++i) {
    const double value = svd.singularValues()[i];
    EXPECT_NEAR(found.eigenvalues[i], value * value / 12, 1e-13);  // eq. 6
    EXPECT_NEAR(std::abs(found.modes.col(i).dot(svd.matrixU().col(i))), 1, 1e-10) << i;
  }
  EXPECT_LT(orthonormality(found.modes), 1e-13);
}

TEST(KarhunenLoeve, ModesAreEigenvectorsOfTheCorrelationMatrix) {
  const Matrix q = snapshots(40, 6, 0.5);
  const auto found = karhunen_loeve(q, 4);
  const Matrix c = q * q.transpose() / 6;
  ASSERT_EQ(found.modes.cols(), 4);
  EXPECT_EQ(found.eigenvalues.size(), 6);
  EXPECT_LT((c * found.modes - found.modes * found.eigenvalues.head(4).asDiagonal()).norm(), 1e-12);
  EXPECT_NEAR(found.eigenvalues.sum(), c.trace(), 1e-12);
}

// Eigenvalues from 9 down to 1e-13 of it: the vectors themselves are no longer orthogonal.
TEST(KarhunenLoeve, ModesOfSmallEigenvaluesStayOrthonormal) {
  const auto found = karhunen_loeve(snapshots(200, 14, 0.32), 14);
  EXPECT_GE(found.modes.cols(), 12);
  EXPECT_LT(orthonormality(found.modes), 1e-13);
}

TEST(KarhunenLoeve, ThereAreNoMoreModesThanTheSnapshotsSpan) {
  Matrix q = snapshots(30, 3, 0.5);
  q.conservativeResize(Eigen::NoChange, 7);
  for (Eigen::Index i = 3; i < 7; ++i) q.col(i) = 0.5 * q.col(i - 3) - q.col(0);
  EXPECT_EQ(karhunen_loeve(q, 7).modes.cols(), 3);
  EXPECT_EQ(karhunen_loeve(Matrix::Zero(30, 4), 4).modes.cols(), 0);
  EXPECT_EQ(karhunen_loeve(Matrix(30, 0), 4).modes.cols(), 0);
}

}  // namespace
}  // namespace trocar::dogan
