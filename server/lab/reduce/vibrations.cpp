#include "server/lab/reduce/vibrations.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "common/base/mix.h"

namespace trocar::reduce {
namespace {

// Beyond `count`, so that the last ones converge, too.
constexpr std::size_t kGuardModes = 8;
constexpr int kMaxVibrationIterations = 40;
constexpr double kSettledRate = 1e-6;  // change of the squares of rates

}  // namespace

Vibrations slowest_vibrations(FullModel& model, std::size_t count) {
  const auto& organ = model.organ();
  const auto length = static_cast<Eigen::Index>(model.dof_count());
  const auto free = static_cast<std::size_t>(
      std::ranges::count_if(model.free_of_dof(), [](int number) { return number >= 0; }));
  count = std::min(count, free);
  if (count == 0) return {Matrix(length, 0), {}};
  const auto width = static_cast<Eigen::Index>(std::min(count + kGuardModes, free));
  Vector masses(length);
  for (Eigen::Index i = 0; i < length; ++i)
    masses[i] = organ.node_masses_kg[static_cast<std::size_t>(i / 3)];
  Matrix x = Matrix::Zero(length, width);
  for (Eigen::Index c = 0; c < width; ++c)
    for (Eigen::Index i = 0; i < length; ++i)
      if (model.free_of_dof()[static_cast<std::size_t>(i)] >= 0)
        x(i, c) =
            static_cast<double>(mix_bits(static_cast<std::uint64_t>(c * length + i) + 1) >> 11) /
                9007199254740992.0 -
            0.5;
  Vector squares = Vector::Zero(width);
  for (int iteration = 0; iteration < kMaxVibrationIterations; ++iteration) {
    const Matrix loads = masses.asDiagonal() * x;
    const Matrix moved = model.linear_displacements(loads);
    // Among K^-1 M x: stiffness moved^T K moved, mass moved^T M moved.
    const Matrix stiffness = moved.transpose() * loads;
    const Matrix mass = moved.transpose() * (masses.asDiagonal() * moved).eval();
    const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix> found(
        (stiffness + stiffness.transpose()) / 2, (mass + mass.transpose()) / 2);
    x = moved * found.eigenvectors();
    const Vector before = squares;
    squares = found.eigenvalues();
    const auto kept = static_cast<Eigen::Index>(count);
    if ((squares - before).head(kept).cwiseAbs().maxCoeff() <= kSettledRate * squares[kept - 1])
      break;
  }
  Vibrations vibrations{x.leftCols(static_cast<Eigen::Index>(count)), {}};
  for (std::size_t i = 0; i < count; ++i)
    vibrations.rates_s.push_back(std::sqrt(squares[static_cast<Eigen::Index>(i)]));
  return vibrations;
}

}  // namespace trocar::reduce
