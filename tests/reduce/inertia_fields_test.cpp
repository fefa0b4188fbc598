// Fields that inertia adds, against the organ's own response to forces of one rate.

#include "server/lab/reduce/inertia_fields.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SparseLU>
#include <cmath>
#include <numbers>

#include "server/lab/reduce/vibrations.h"
#include "tests/reduce/small_organ.h"

namespace trocar::reduce {
namespace {

class InertiaFields : public ::testing::Test {
 protected:
  InertiaFields() : organ_(testing::block(8, 5, 8)) {
    auto model = FullModel::create(organ_);
    TROCAR_ASSERT(model.ok());
    model_ = std::move(*model);
    std::size_t top = 0;
    for (std::size_t n = 1; n < organ_.mesh.node_count(); ++n)
      if (organ_.mesh.rest_positions[n].y > organ_.mesh.rest_positions[top].y) top = n;
    forces_ = Matrix::Zero(length(), 3);
    forces_.middleRows<3>(3 * static_cast<Eigen::Index>(top)).setIdentity();
    greens_ = model_->linear_displacements(forces_);
    Matrix modes = slowest_vibrations(*model_, 8).modes;
    // The fields become orthonormal; their span stays the same.
    vibrations_ = Eigen::HouseholderQR<Matrix>(modes).householderQ() *
                  Matrix::Identity(modes.rows(), modes.cols());
  }

  Eigen::Index length() const { return static_cast<Eigen::Index>(model_->dof_count()); }

  // K - w^2 M of what is not held, and rows of `of` there.
  void dynamic(double rate_s, finite_elements::SparseMatrix& k, Matrix& f, const Matrix& of) const {
    const auto& numbers = model_->free_of_dof();
    const finite_elements::SparseMatrix lower = model_->rest_tangent();
    k = lower.selfadjointView<Eigen::Lower>();
    f = Matrix(k.rows(), of.cols());
    for (std::size_t dof = 0; dof < numbers.size(); ++dof) {
      if (numbers[dof] < 0) continue;
      k.coeffRef(numbers[dof], numbers[dof]) -= rate_s * rate_s * organ_.node_masses_kg[dof / 3];
      f.row(numbers[dof]) = of.row(static_cast<Eigen::Index>(dof));
    }
  }

  // Returns the error of the response at the node that is struck, in a basis beside all degrees of
  // freedom.
  double error(const Matrix& basis, double rate_hz) const {
    finite_elements::SparseMatrix k;
    Matrix f, b;
    dynamic(2 * std::numbers::pi * rate_hz, k, b, basis);
    dynamic(2 * std::numbers::pi * rate_hz, k, f, forces_);
    Eigen::SparseLU<Eigen::SparseMatrix<double>> factors{Eigen::SparseMatrix<double>(k)};
    const Matrix exact = f.transpose() * factors.solve(f);
    const Matrix reduced =
        f.transpose() * b * (b.transpose() * (k * b)).fullPivLu().solve(b.transpose() * f);
    return (reduced - exact).norm() / exact.norm();
  }

  static Matrix joined(const Matrix& a, const Matrix& b) {
    Matrix both(a.rows(), a.cols() + b.cols());
    both << a, b;
    return both;
  }

  const organ::Organ organ_;
  std::unique_ptr<FullModel> model_;
  Matrix forces_, greens_, vibrations_;
};

TEST_F(InertiaFields, TheResponseToForcesThatChangeIsThatOfTheOrgan) {
  const Matrix at_rest = joined(vibrations_, greens_);
  const Matrix modes = inertia_modes(*model_, greens_, vibrations_, greens_, 3);
  ASSERT_EQ(modes.cols(), 3);
  const Matrix both = joined(at_rest, modes);
  const double ends_hz = slowest_vibrations(*model_, 8).rates_s.back() / (2 * std::numbers::pi);
  for (const double part : {0.3, 0.6, 0.9})
    EXPECT_LT(error(both, part * ends_hz), 0.15 * error(at_rest, part * ends_hz)) << part;
  // Fields K^-1 f follow the response to the order w^2, in a symmetric basis w^4 remains; with
  // these, w^8. Far below the vibrations, where rounding does not show yet.
  const double order_rest =
                   std::log2(error(at_rest, 0.4 * ends_hz) / error(at_rest, 0.2 * ends_hz)),
               order_both = std::log2(error(both, 0.4 * ends_hz) / error(both, 0.2 * ends_hz));
  EXPECT_NEAR(order_rest, 4, 0.5);
  EXPECT_NEAR(order_both, 8, 0.8);
}

TEST_F(InertiaFields, AreOrthonormalAndOfNothingThatIsKnown) {
  Matrix known = joined(greens_, greens_.leftCols(1) * 2);  // not of full rank
  const Matrix modes = inertia_modes(*model_, greens_, vibrations_, known, 8);
  ASSERT_EQ(modes.cols(), 3);  // as many as there are
  EXPECT_LT((modes.transpose() * modes - Matrix::Identity(3, 3)).norm(), 1e-10);
  EXPECT_LT((modes.transpose() * vibrations_).norm(), 1e-10);
  EXPECT_LT((modes.transpose() * orthogonal_to(vibrations_, greens_)).norm() / greens_.norm(),
            1e-10);
  EXPECT_EQ(inertia_modes(*model_, greens_, vibrations_, known, 0).cols(), 0);
}

}  // namespace
}  // namespace trocar::reduce
