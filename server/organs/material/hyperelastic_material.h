#pragma once

// Measured materials: a strain energy that depends on the first invariant of the right
// Cauchy-Green tensor C, a volumetric energy, and quasi-linear viscoelastic relaxation
// (Dogan 2011 eq. 1 to 5). SI units; constants are those of the instantaneous response.
//
//   unsplit:    W = [Psi(I1) - 2 C10 (J - 1)] + K/2 (J - 1)^2, I1 = tr C, J = sqrt(det C)
//   isochoric:  W = [Psi(I1 J^(-2/3))]        + K/2 (J - 1)^2
//
// Both brackets are free of stress at rest and only they relax: after a step of strain their
// second Piola-Kirchhoff stress falls as G(t) = 1 - sum g_k (1 - exp(-t / tau_k)); the volumetric
// part keeps its own. Psi in e = I1 - 3:
//
//   reduced polynomial:  sum_i C_i0 e^i, i = 1 to 5  (Dogan 2011 eq. 5)
//   exponential:         C10 / b (exp(b e) - 1)      (Fung's type; Demiray 1972)
//
// Up to e = 0, where only the unsplit form comes, Psi is continued linearly with its slope C10. In
// the unsplit form C20 resists a growth of volume too (by 8 C20 beside K, from e = 0 up).
// Any thread.

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace trocar::material {

inline constexpr std::size_t kMaxPolynomialOrder = 5;
inline constexpr std::size_t kMaxPronyTerms = 4;
inline constexpr double kLargestModulus_pa = 1e12;

enum class StrainEnergy : std::uint8_t { ReducedPolynomial = 0, Exponential = 1 };
enum class VolumeSplit : std::uint8_t { Unsplit = 0, Isochoric = 1 };

struct PronyTerm {
  double weight = 0;             // g_k, share of the bracket's stress that goes
  double relaxation_time_s = 0;  // tau_k

  bool operator==(const PronyTerm&) const = default;
};

struct HyperelasticMaterial {
  std::string name, source;
  StrainEnergy energy = StrainEnergy::ReducedPolynomial;
  VolumeSplit split = VolumeSplit::Unsplit;
  // These are C10 to C50; the exponential law has only C10.
  std::array<double, kMaxPolynomialOrder> coefficients_pa{};
  double exponent = 0;  // b of the exponential law
  double bulk_modulus_pa = 0;
  std::vector<PronyTerm> relaxation;

  // This share of the bracket's stress remains in the end: 1 - sum g_k.
  double equilibrium_share() const;

  bool operator==(const HyperelasticMaterial&) const = default;
};

// Psi and its derivatives by e, Pa; linear up to e = 0.
struct StrainEnergySlopes {
  double energy = 0, first = 0, second = 0;
};
StrainEnergySlopes strain_energy(const HyperelasticMaterial& material, double e);

// Homogeneous deformations of an incompressible specimen in which a law must stay monotone.
enum class TestMode : std::uint8_t { Uniaxial = 0, Equibiaxial = 1, SimpleShear = 2 };
const char* name_of(TestMode mode);

// Nominal stress of the incompressible material at a stretch (shear: amount of shear), Pa.
double incompressible_stress(const HyperelasticMaterial& material, TestMode mode, double stretch);

// In this range of stretches, stress must grow with stretch and stretch be resisted at all. The
// range is wider than what tissue bears; a law that is stable in it may still fail beyond.
struct StabilityRange {
  double uniaxial_low = 0.4, uniaxial_high = 2.0;        // stretch
  double equibiaxial_low = 0.6, equibiaxial_high = 1.6;  // stretch
  double shear_high = 1.5;
};
struct Instability {
  TestMode mode = TestMode::Uniaxial;
  double stretch = 1;  // the first on the way from rest; of simple shear the amount of shear
};
// The failure nearest to rest, if there is one; found to 1e-6. Bounded work: 1,000 points a mode.
std::optional<Instability> find_instability(const HyperelasticMaterial& material,
                                            const StabilityRange& range = {});

// Error: a number out of its range, or an unstable law with the strain at which it fails.
Status validate(const HyperelasticMaterial& material, const StabilityRange& range = {});

// Materials that ship with Trocar, each with its source, by name.
std::span<const HyperelasticMaterial> measured_materials();
const HyperelasticMaterial* find_measured_material(std::string_view name);
// "a, b, c", for messages.
std::string measured_material_names();

}  // namespace trocar::material
