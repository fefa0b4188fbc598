#pragma once

// Work of one thread that makes patches: fields of unit forces and of second order, and the forces
// of single tets in double precision.

#include <memory>
#include <optional>
#include <span>

#include "server/lab/finite_elements/stress.h"
#include "server/lab/reduce/full_model.h"
#include "server/organs/organ/local_reduction.h"

namespace trocar::reduce {

using finite_elements::Matrix3;

// Values over `out`, which is of their number.
void unpack(const organ::PackedField& field, Eigen::Ref<Vector> out);

// u = G f + second order in f, as columns: G F along x, y and z, then the six fields that F^2 f_i
// f_j multiply, of xx, xy, xz, yy, yz and zz (off-diagonal ones once, for the sum of ij and ji),
// from differences of the tissue's resistance.
Matrix series_of(FullModel& model, const Matrix& greens, double force_n);
// The state under a force of that series (in parts of F) or, where it turns a tet inside out, under
// a half, a quarter or an eighth of it; nothing if none will do.
std::optional<Vector> state_of(FullModel& model, const Matrix& series,
                               const Eigen::Vector3d& force);

// This is one tet of the model.
class TetForces {
 public:
  TetForces(const FullModel& model, TetIndex tet);

  double volume() const { return volume_; }
  // Returns the gradient of a field in the tet.
  Matrix3 gradient(const Eigen::Ref<const Vector>& field) const;
  // Gradients of some fields, a column each.
  Matrix gradients(const Matrix& fields) const;
  // First Piola-Kirchhoff stress of a displacement gradient, to first order, and what is beyond it;
  // nothing where the tet is turned inside out.
  Matrix3 linear_stress(const Matrix3& gradient) const;
  std::optional<Matrix3> nonlinear_stress(const Matrix3& gradient) const;

 private:
  const material::HyperelasticMaterial& material_;
  mesh::Tet nodes_;
  double volume_ = 0;
  Eigen::Matrix<double, 4, 3> shapes_;
  finite_elements::Matrix6 tangent_;  // at rest
};

}  // namespace trocar::reduce
