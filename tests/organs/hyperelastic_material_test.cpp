// Measured materials: what ships, what is refused, where laws become unstable.

#include "server/organs/material/hyperelastic_material.h"

#include <gtest/gtest.h>

#include <cmath>

namespace trocar::material {
namespace {

HyperelasticMaterial liver() {
  return *find_measured_material("human_liver_nava2008");
}

void expect_refused(const HyperelasticMaterial& material, const std::string& says) {
  const auto status = validate(material);
  ASSERT_FALSE(status.ok()) << says;
  EXPECT_NE(status.error().message.find(says), std::string::npos) << status.error().message;
  EXPECT_EQ(status.error().message.find('\n'), std::string::npos);
}

TEST(HyperelasticMaterial, TableOneShipsWithItsSource) {
  const auto m = liver();
  EXPECT_TRUE(validate(m).ok());
  EXPECT_EQ(m.coefficients_pa, (std::array<double, 5>{883.8, 1707.9, 1449.9, 2691.8, 1757.5}));
  EXPECT_NEAR(m.equilibrium_share(), 0.3461, 1e-12);
  EXPECT_NE(m.source.find("Nava"), std::string::npos);
  EXPECT_EQ(find_measured_material("liver"), nullptr);
  for (const auto& material : measured_materials()) {
    EXPECT_TRUE(validate(material).ok());
    EXPECT_FALSE(material.source.empty());
  }
}

TEST(HyperelasticMaterial, SlopesAreThoseOfTheEnergy) {
  auto fung = liver();
  fung.energy = StrainEnergy::Exponential;
  fung.exponent = 3;
  for (const auto& m : {liver(), fung})
    for (const double e : {-0.2, 0.05, 0.7}) {
      constexpr double kStep = 1e-6;
      const auto low = strain_energy(m, e - kStep), high = strain_energy(m, e + kStep);
      const auto at = strain_energy(m, e);
      EXPECT_NEAR(at.first, (high.energy - low.energy) / (2 * kStep), 1e-4);
      EXPECT_NEAR(at.second, (high.first - low.first) / (2 * kStep), 1e-3);
    }
  EXPECT_EQ(strain_energy(liver(), -0.5).first, liver().coefficients_pa[0])
      << "linear below I1 = 3";
}

TEST(HyperelasticMaterial, StressesOfTheIncompressibleSpecimen) {
  const auto m = liver();
  // 2 Psi'(I1) (s - 1 / s^2) at s = 2: I1 = 5.
  const double slope = 883.8 + 2 * 1707.9 * 2 + 3 * 1449.9 * 4 + 4 * 2691.8 * 8 + 5 * 1757.5 * 16;
  EXPECT_NEAR(incompressible_stress(m, TestMode::Uniaxial, 2), 2 * slope * 1.75, 1e-6);
  EXPECT_EQ(incompressible_stress(m, TestMode::Equibiaxial, 1), 0);
  EXPECT_NEAR(incompressible_stress(m, TestMode::SimpleShear, 1e-6), 2 * 883.8e-6, 1e-9);
}

TEST(HyperelasticMaterial, NamesTheStrainAtWhichAPolynomialFails) {
  // Psi' = C10 + 2 C20 e; in shear the stress 2 Psi' g has its top where C10 + 6 C20 g^2 = 0.
  HyperelasticMaterial m = liver();
  m.coefficients_pa = {1000, -600, 0, 0, 0};
  const double shear = std::sqrt(1000.0 / 3600);
  const StabilityRange only_shear{1, 1, 1, 1, 1.5};
  const auto found = find_instability(m, only_shear);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->mode, TestMode::SimpleShear);
  EXPECT_NEAR(found->stretch, shear, 1e-5);
  expect_refused(m, "unstable: in ");
  m.coefficients_pa = {1000, -5, 0, 0, 0};
  EXPECT_TRUE(validate(m).ok()) << "stable as far as is asked";
}

TEST(HyperelasticMaterial, RefusesNumbersThatMakeNoTissue) {
  auto m = liver();
  m.coefficients_pa[0] = -5;
  expect_refused(m, "C10 = -5 Pa is not above 0");
  m = liver();
  m.coefficients_pa[3] = NAN;
  expect_refused(m, "not a number of Pa");
  m = liver();
  m.bulk_modulus_pa = 100;
  expect_refused(m, "bulk modulus");
  m = liver();
  m.relaxation[0].weight = -0.1;
  expect_refused(m, "g1 = -0.1 is negative");
  m = liver();
  m.relaxation[1].weight = 0.5;
  expect_refused(m, "add up to 1.0054");
  m = liver();
  m.relaxation[1].relaxation_time_s = 0;
  expect_refused(m, "tau2 = 0 s is not above 0");
  m = liver();
  m.relaxation.resize(5, {0.01, 1});
  expect_refused(m, "more than 4");
  m = liver();
  m.energy = StrainEnergy::Exponential;
  expect_refused(m, "exponent 0");
}

}  // namespace
}  // namespace trocar::material
