// The material laws at one point: derivatives, rest, frames, closed forms.

#include "server/lab/finite_elements/stress.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "tests/finite_elements/specimens.h"
#include "tests/support/random.h"

namespace trocar::finite_elements::testing {
namespace {

std::vector<HyperelasticMaterial> laws() {
  HyperelasticMaterial isochoric = liver(), fung = liver(), fung_isochoric = liver();
  isochoric.split = material::VolumeSplit::Isochoric;
  fung.energy = material::StrainEnergy::Exponential;
  fung.exponent = 2.5;
  fung_isochoric = fung;
  fung_isochoric.split = material::VolumeSplit::Isochoric;
  return {liver(), isochoric, fung, fung_isochoric, neo_hookean(4000, 0.3)};
}

Matrix3 random_gradient(trocar::testing::Random& random, double amplitude) {
  Matrix3 f = Matrix3::Identity();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) f(i, j) += random.between(-amplitude, amplitude);
  return f;
}

Matrix3 green_strain(const Matrix3& f) {
  return (f.transpose() * f - Matrix3::Identity()) / 2;
}

// A trial holds the stresses at a gradient `f`, and a small step back and ahead in direction `d`.
struct Trial {
  HyperelasticMaterial law;
  Matrix3 f, d;
  Stress at, low, high;
};
constexpr double kStep = 1e-6;

std::vector<Trial> random_trials(std::uint64_t seed) {
  trocar::testing::Random random(seed);
  std::vector<Trial> trials;
  for (const auto& law : laws())
    for (int i = 0; i < 20; ++i) {
      const Matrix3 f = random_gradient(random, 0.3);
      const Matrix3 d = random_gradient(random, 1) - Matrix3::Identity();
      trials.push_back({law, f, d, stress_of(law, f).value(), stress_of(law, f - kStep * d).value(),
                        stress_of(law, f + kStep * d).value()});
    }
  return trials;
}

// Both parts' stresses times the change of Green's strain is the change of their energies.
TEST(Stress, IsTheDerivativeOfTheEnergy) {
  for (const auto& [law, f, d, at, low, high] : random_trials(1))
    for (const auto part : {&Stress::relaxing, &Stress::volumetric}) {
      const double expected = ((high.*part).energy - (low.*part).energy) / (2 * kStep);
      const double ours = ((f * to_matrix((at.*part).stress)).array() * d.array()).sum();
      EXPECT_NEAR(ours, expected, 1e-6 * law.bulk_modulus_pa) << law.name;
    }
}

TEST(Stress, TangentIsTheDerivativeOfTheStress) {
  for (const auto& [law, f, d, at, low, high] : random_trials(2)) {
    const Matrix3 de = (green_strain(f + kStep * d) - green_strain(f - kStep * d)) / (2 * kStep);
    Vector6 strain;
    strain << de(0, 0), de(1, 1), de(2, 2), 2 * de(0, 1), 2 * de(1, 2), 2 * de(2, 0);
    for (const auto part : {&Stress::relaxing, &Stress::volumetric}) {
      const Vector6 expected = ((high.*part).stress - (low.*part).stress) / (2 * kStep);
      EXPECT_LT(((at.*part).tangent * strain - expected).norm(), 2e-6 * law.bulk_modulus_pa);
      EXPECT_LT(((at.*part).tangent - (at.*part).tangent.transpose()).norm(), 1e-9);
    }
  }
}

TEST(Stress, RestIsFreeOfIt) {
  for (const auto& law : laws()) {
    const auto rest = stress_of(law, Matrix3::Identity());
    ASSERT_TRUE(rest);
    EXPECT_EQ(rest->relaxing.stress.norm(), 0);
    EXPECT_EQ(rest->volumetric.stress.norm(), 0);
  }
}

// A rotation after the deformation changes nothing; one before turns the stress with it.
TEST(Stress, IsObjectiveAndIsotropic) {
  trocar::testing::Random random(3);
  for (const auto& law : laws())
    for (int trial = 0; trial < 20; ++trial) {
      const Matrix3 f = random_gradient(random, 0.3);
      const Eigen::Vector3d axis(random.between(-1, 1), random.between(-1, 1), 1);
      const Matrix3 r = Eigen::AngleAxisd(random.between(-3, 3), axis.normalized()).matrix();
      for (const auto part : {&Stress::relaxing, &Stress::volumetric}) {
        const auto stress = [&](const Matrix3& g) {
          return to_matrix((*stress_of(law, g).*part).stress).eval();
        };
        const Matrix3 s = stress(f);
        EXPECT_LT((stress(r * f) - s).norm(), 1e-12 * law.bulk_modulus_pa);
        EXPECT_LT((stress(f * r) - r.transpose() * s * r).norm(), 1e-12 * law.bulk_modulus_pa);
      }
    }
}

TEST(Stress, RefusesWhatIsTurnedInsideOut) {
  Matrix3 f = Matrix3::Identity();
  f(2, 2) = -0.5;
  EXPECT_FALSE(stress_of(liver(), f));
  f(2, 2) = 0;
  EXPECT_FALSE(stress_of(liver(), f));
}

// To second order both forms are linear elasticity; nu = 0.475 at K = 40 C10 in the unsplit form.
TEST(Stress, SmallStrainsAreThoseOfLinearElasticity) {
  const double mu = 2 * liver().coefficients_pa[0], k = liver().bulk_modulus_pa;
  const auto rest = stress_of(liver(), Matrix3::Identity());
  const Matrix6 tangent = rest->relaxing.tangent + rest->volumetric.tangent;
  EXPECT_NEAR(tangent(3, 3), mu, 1e-9 * mu);
  EXPECT_NEAR(tangent(0, 1), k - mu, 1e-9 * k) << "lambda";
  auto isochoric = liver();
  isochoric.split = material::VolumeSplit::Isochoric;
  isochoric.coefficients_pa = {liver().coefficients_pa[0], 0, 0, 0, 0};
  const auto other = stress_of(isochoric, Matrix3::Identity());
  const Matrix6 split = other->relaxing.tangent + other->volumetric.tangent;
  EXPECT_NEAR(split(3, 3), mu, 1e-9 * mu);
  EXPECT_NEAR(split(0, 1), k - 2 * mu / 3, 1e-9 * k);
}

}  // namespace
}  // namespace trocar::finite_elements::testing
