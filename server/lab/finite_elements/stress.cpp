#include "server/lab/finite_elements/stress.h"

#include <Eigen/LU>
#include <cmath>

namespace trocar::finite_elements {
namespace {

constexpr double kLeastVolumeRatio = 1e-4;

Vector6 to_vector(const Matrix3& a) {
  Vector6 v;
  v << a(0, 0), a(1, 1), a(2, 2), a(0, 1), a(1, 2), a(2, 0);
  return v;
}

// (A x A)_ijkl = (A_ik A_jl + A_il A_jk) / 2 for symmetric A.
Matrix6 symmetric_product(const Matrix3& a) {
  static constexpr int kRow[6] = {0, 1, 2, 0, 1, 2}, kColumn[6] = {0, 1, 2, 1, 2, 0};
  Matrix6 m;
  for (int p = 0; p < 6; ++p)
    for (int q = 0; q < 6; ++q) {
      const int i = kRow[p], j = kColumn[p], k = kRow[q], l = kColumn[q];
      m(p, q) = (a(i, k) * a(j, l) + a(i, l) * a(j, k)) / 2;
    }
  return m;
}

struct Kinematics {
  double i1 = 0, volume_ratio = 1;
  Vector6 inverse;          // of C
  Matrix6 inverse_outer;    // C^-1 (x) C^-1
  Matrix6 inverse_product;  // -dC^-1/dE / 2
};

// Psi(I1) - 2 C10 (J - 1).
StressPart unsplit(const material::HyperelasticMaterial& m, const Kinematics& k) {
  const double c10 = m.coefficients_pa[0], j = k.volume_ratio;
  const auto psi = material::strain_energy(m, k.i1 - 3);
  StressPart part;
  part.energy = psi.energy - 2 * c10 * (j - 1);
  part.stress = -2 * c10 * j * k.inverse;
  part.stress.head<3>().array() += 2 * psi.first;
  part.tangent = -2 * c10 * j * (k.inverse_outer - 2 * k.inverse_product);
  part.tangent.topLeftCorner<3, 3>().array() += 4 * psi.second;
  return part;
}

// Psi(I1 J^(-2/3)).
StressPart isochoric(const material::HyperelasticMaterial& m, const Kinematics& k) {
  const double a = 1 / std::cbrt(k.volume_ratio * k.volume_ratio);
  const auto psi = material::strain_energy(m, a * k.i1 - 3);
  Vector6 identity;
  identity << 1, 1, 1, 0, 0, 0;
  const Vector6 direction = identity - k.i1 / 3 * k.inverse;  // of dI1/dC, scaled by a
  const double p = 2 * psi.first * a;
  StressPart part;
  part.energy = psi.energy;
  part.stress = p * direction;
  const Matrix6 mixed = identity * k.inverse.transpose();
  part.tangent = 4 * psi.second * a * a * direction * direction.transpose();
  part.tangent += p * (-2.0 / 3 * (mixed + mixed.transpose()) + 2.0 / 9 * k.i1 * k.inverse_outer +
                       2.0 / 3 * k.i1 * k.inverse_product);
  return part;
}

// K/2 (J - 1)^2.
StressPart volumetric(const material::HyperelasticMaterial& m, const Kinematics& k) {
  const double bulk = m.bulk_modulus_pa, j = k.volume_ratio;
  StressPart part;
  part.energy = bulk / 2 * (j - 1) * (j - 1);
  part.stress = bulk * (j - 1) * j * k.inverse;
  part.tangent = bulk * j * ((2 * j - 1) * k.inverse_outer - 2 * (j - 1) * k.inverse_product);
  return part;
}

}  // namespace

std::optional<Stress> stress_of(const material::HyperelasticMaterial& material, const Matrix3& f) {
  Kinematics k;
  k.volume_ratio = f.determinant();
  if (!(k.volume_ratio > kLeastVolumeRatio)) return std::nullopt;
  const Matrix3 c = f.transpose() * f;
  const Matrix3 inverse = c.inverse();
  k.i1 = c.trace();
  k.inverse = to_vector(inverse);
  k.inverse_outer = k.inverse * k.inverse.transpose();
  k.inverse_product = symmetric_product(inverse);
  return Stress{material.split == material::VolumeSplit::Isochoric ? isochoric(material, k)
                                                                   : unsplit(material, k),
                volumetric(material, k)};
}

Matrix3 to_matrix(const Vector6& s) {
  Matrix3 m;
  m << s(0), s(3), s(5), s(3), s(1), s(4), s(5), s(4), s(2);
  return m;
}

}  // namespace trocar::finite_elements
