#include "server/lab/reduce/patch_fields.h"

#include "server/lab/reduce/eigen_index.h"
#include "server/tissue/topology/tet_shape.h"

namespace trocar::reduce {
namespace {

// Part of the whole force at which second order is found: below, the laws' kink at rest shows,
// above what is of third order.
constexpr double kDifference = 0.1;
constexpr double kLeastShare = 0.125;

finite_elements::Vector6 small_strain(const Matrix3& h) {
  finite_elements::Vector6 e;
  e << h(0, 0), h(1, 1), h(2, 2), h(0, 1) + h(1, 0), h(1, 2) + h(2, 1), h(2, 0) + h(0, 2);
  return e;
}

}  // namespace

void unpack(const organ::PackedField& field, Eigen::Ref<Vector> out) {
  for (std::size_t i = 0; i < field.values.size(); ++i)
    out[index(i)] = static_cast<double>(field.values[i]) * static_cast<double>(field.step);
}

Matrix series_of(FullModel& model, const Matrix& greens, double force_n) {
  const Matrix first = greens * force_n;
  // There is no second order where a tet would turn inside out.
  const auto resistance = [&](const Vector& u) {
    auto found = model.resistance(kDifference * u);
    return found ? std::move(*found) : Vector(Vector::Zero(u.size()));
  };
  Matrix forces(first.rows(), 6);
  Eigen::Index column = 0;
  for (Eigen::Index i = 0; i < 3; ++i)
    for (Eigen::Index j = i; j < 3; ++j) {
      const Vector a = first.col(i), b = first.col(j);
      // f(u) = K u + Q(u, u): the even part is Q.
      forces.col(column++) = i == j ? Vector(-(resistance(a) + resistance(-a)) / 2)
                                    : Vector(-(resistance(a + b) + resistance(-a - b) -
                                               resistance(a - b) - resistance(b - a)) /
                                             4);
    }
  Matrix series(first.rows(), 9);
  series.leftCols(3) = first;
  series.rightCols(6) = model.linear_displacements(forces / (kDifference * kDifference));
  return series;
}

std::optional<Vector> state_of(FullModel& model, const Matrix& series,
                               const Eigen::Vector3d& force) {
  for (double share = 1; share >= kLeastShare; share /= 2) {
    const Eigen::Vector3d f = share * force;
    Eigen::Matrix<double, 9, 1> parts;
    parts << f, f[0] * f[0], f[0] * f[1], f[0] * f[2], f[1] * f[1], f[1] * f[2], f[2] * f[2];
    Vector state = series * parts;
    if (model.resistance(state)) return state;
  }
  return std::nullopt;
}

TetForces::TetForces(const FullModel& model, TetIndex tet)
    : material_(model.material_of(tet)), nodes_(model.organ().mesh.tets[tet.value]) {
  const auto shape = topology::tet_shape(model.organ().mesh.rest_positions, nodes_);
  volume_ = shape.volume;
  for (std::size_t k = 0; k < 4; ++k) {
    const Vec3d& g = shape.gradients[k];
    shapes_.row(index(k)) << g.x, g.y, g.z;
  }
  const auto rest = finite_elements::stress_of(model.rest_material_of(tet), Matrix3::Identity());
  TROCAR_ASSERT(rest.has_value());
  tangent_ = rest->relaxing.tangent + rest->volumetric.tangent;
}

Matrix3 TetForces::gradient(const Eigen::Ref<const Vector>& field) const {
  Matrix3 h = Matrix3::Zero();
  for (std::size_t k = 0; k < 4; ++k)
    h += field.segment<3>(3 * static_cast<Eigen::Index>(nodes_[k].value)) * shapes_.row(index(k));
  return h;
}

Matrix TetForces::gradients(const Matrix& fields) const {
  Matrix all(9, fields.cols());
  for (Eigen::Index c = 0; c < fields.cols(); ++c)
    Eigen::Map<Matrix3>(all.col(c).data()) = gradient(fields.col(c));
  return all;
}

Matrix3 TetForces::linear_stress(const Matrix3& gradient) const {
  return finite_elements::to_matrix(tangent_ * small_strain(gradient));
}

std::optional<Matrix3> TetForces::nonlinear_stress(const Matrix3& gradient) const {
  const Matrix3 f = Matrix3::Identity() + gradient;
  const auto stress = finite_elements::stress_of(material_, f);
  if (!stress) return std::nullopt;
  return Matrix3(
      f * finite_elements::to_matrix(stress->relaxing.stress + stress->volumetric.stress) -
      linear_stress(gradient));
}

}  // namespace trocar::reduce
