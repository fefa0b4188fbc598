#include "server/reduction/karhunen_loeve.h"

#include <Eigen/Eigenvalues>

namespace trocar::reduction {
namespace {

// Below, an eigenvalue is made of rounding errors of the products of snapshots.
constexpr double kRank = 1e-14;

}  // namespace

KarhunenLoeve karhunen_loeve(const Matrix& snapshots, std::size_t mode_count) {
  KarhunenLoeve result;
  const auto count = snapshots.cols();
  if (count == 0) return result;
  const Matrix products = snapshots.transpose() * snapshots / static_cast<double>(count);
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(products);
  result.eigenvalues = solver.eigenvalues().reverse().cwiseMax(0);
  Eigen::Index rank = 0;
  while (rank < std::min(count, static_cast<Eigen::Index>(mode_count)) &&
         result.eigenvalues[rank] > kRank * result.eigenvalues[0])
    ++rank;
  result.modes.resize(snapshots.rows(), rank);
  for (Eigen::Index i = 0; i < rank; ++i) {
    Vector mode = snapshots * solver.eigenvectors().col(count - 1 - i);
    mode.normalize();
    // Of small eigenvalues rounding leaves a part along the modes before; once is not enough.
    for (int pass = 0; pass < 2; ++pass) {
      const auto before = result.modes.leftCols(i);
      mode -= before * (before.transpose() * mode).eval();
      mode.normalize();
    }
    result.modes.col(i) = mode;
  }
  return result;
}

}  // namespace trocar::reduction
