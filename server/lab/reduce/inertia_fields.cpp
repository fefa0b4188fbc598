#include "server/lab/reduce/inertia_fields.h"

#include <Eigen/QR>

namespace trocar::reduce {
namespace {

// Columns of which less than this is new are of those before.
constexpr double kRankThreshold = 1e-8;

}  // namespace

Matrix inertia_modes(FullModel& model, const Matrix& fields, const Matrix& vibrations,
                     const Matrix& known, std::size_t count) {
  if (count == 0) return Matrix(fields.rows(), 0);
  const auto& masses = model.organ().node_masses_kg;
  Matrix loads = fields;
  for (Eigen::Index i = 0; i < loads.rows(); ++i)
    loads.row(i) *= masses[static_cast<std::size_t>(i / 3)];
  const Matrix moved = orthogonal_to(vibrations, model.linear_displacements(loads));
  Eigen::ColPivHouseholderQR<Matrix> factors(orthogonal_to(vibrations, known));
  factors.setThreshold(kRankThreshold);
  const Matrix taken = factors.householderQ() * Matrix::Identity(known.rows(), factors.rank());
  return karhunen_loeve(orthogonal_to(taken, moved), count).modes;
}

}  // namespace trocar::reduce
