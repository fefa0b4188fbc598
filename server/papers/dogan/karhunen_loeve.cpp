#include "server/papers/dogan/karhunen_loeve.h"

#include <Eigen/Eigenvalues>

namespace trocar::dogan {
namespace {

// Fields without their parts along the orthonormal columns of a basis (Gram-Schmidt).
Matrix orthogonal_to(const Eigen::Ref<const Matrix>& basis, Matrix fields) {
  // Once leaves what rounding makes of a large part.
  for (int pass = 0; pass < 2; ++pass) fields -= basis * (basis.transpose() * fields).eval();
  return fields;
}

}  // namespace
namespace {

// Below, an eigenvalue is made of rounding errors of the products of snapshots.
constexpr double kLeastEigenvalue = 1e-14;

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
         result.eigenvalues[rank] > kLeastEigenvalue * result.eigenvalues[0])
    ++rank;
  result.modes.resize(snapshots.rows(), rank);
  for (Eigen::Index i = 0; i < rank; ++i) {
    const Vector mode = snapshots * solver.eigenvectors().col(count - 1 - i);
    // For small eigenvalues, rounding leaves a part along the modes before.
    result.modes.col(i) =
        orthogonal_to(result.modes.leftCols(i), mode.normalized()).col(0).normalized();
  }
  return result;
}

}  // namespace trocar::dogan
