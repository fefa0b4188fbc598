#include "server/organs/material/hyperelastic_material.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace trocar::material {
namespace {

constexpr int kStabilityPoints = 1000;
constexpr double kSmallestModulus_pa = 1e-3;
// Beyond it exp(b e) leaves the range of numbers at strains that are tested.
constexpr double kLargestExponent = 50;
// Incompressible in all but name; matrices get no worse than this.
constexpr double kLargestBulkRatio = 1e6;

StrainEnergySlopes polynomial(const HyperelasticMaterial& m, double e) {
  StrainEnergySlopes sum;
  for (std::size_t i = kMaxPolynomialOrder; i-- > 0;) {
    const double c = m.coefficients_pa[i], power = static_cast<double>(i + 1);
    sum.energy = (sum.energy + c) * e;
    sum.first = sum.first * e + power * c;
    if (i > 0) sum.second = sum.second * e + power * (power - 1) * c;
  }
  return sum;
}

StrainEnergySlopes exponential(const HyperelasticMaterial& m, double e) {
  const double c10 = m.coefficients_pa[0], growth = std::exp(m.exponent * e);
  return {c10 * std::expm1(m.exponent * e) / m.exponent, c10 * growth, c10 * m.exponent * growth};
}

Error wrong(const HyperelasticMaterial& m, const std::string& what) {
  return {ErrorCode::BadFile,
          "material " + (m.name.empty() ? "without a name" : m.name) + ": " + what};
}

std::string number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

Status check_relaxation(const HyperelasticMaterial& m) {
  if (m.relaxation.size() > kMaxPronyTerms)
    return wrong(m, "has more than " + std::to_string(kMaxPronyTerms) + " relaxation terms");
  for (std::size_t k = 0; k < m.relaxation.size(); ++k) {
    const auto& [weight, time_s] = m.relaxation[k];
    const std::string index = std::to_string(k + 1);
    if (!(weight >= 0) || !std::isfinite(weight))
      return wrong(m,
                   "g" + index + " = " + number(weight) + " is negative, a weight is at least 0");
    if (!(time_s > 0) || !std::isfinite(time_s))
      return wrong(m, "tau" + index + " = " + number(time_s) + " s is not above 0");
  }
  if (!(m.equilibrium_share() > 0))
    return wrong(m, "the weights g_k add up to " + number(1 - m.equilibrium_share()) +
                        ", keep them below 1: something must carry the load in the end");
  return {};
}

Status check_elasticity(const HyperelasticMaterial& m) {
  const double c10 = m.coefficients_pa[0];
  for (const double c : m.coefficients_pa)
    if (!std::isfinite(c) || std::abs(c) > kLargestModulus_pa)
      return wrong(m, "a coefficient C_i0 is not a number of Pa below 1e12");
  if (!(c10 >= kSmallestModulus_pa))
    return wrong(m, "C10 = " + number(c10) + " Pa is not above 0, tissue would have no stiffness");
  if (!(m.bulk_modulus_pa >= 2 * c10) || m.bulk_modulus_pa > kLargestBulkRatio * c10)
    return wrong(m, "bulk modulus " + number(m.bulk_modulus_pa) +
                        " Pa is not from 2 to 1e6 times C10 = " + number(c10) + " Pa");
  if (m.energy == StrainEnergy::Exponential && !(m.exponent > 0 && m.exponent <= kLargestExponent))
    return wrong(m, "exponent " + number(m.exponent) + " is not above 0 and at most 50");
  return {};
}

// Stress grows from `before` to `stretch`, away from rest.
bool is_monotone(const HyperelasticMaterial& m, TestMode mode, double before, double stretch) {
  const double rise =
      incompressible_stress(m, mode, stretch) - incompressible_stress(m, mode, before);
  return rise * (stretch - before) > 0;
}

std::optional<double> first_failure(const HyperelasticMaterial& m, TestMode mode, double rest,
                                    double end) {
  constexpr double kDifference = 1e-6;
  const double step = (end - rest) / kStabilityPoints;
  const double small = std::copysign(kDifference, step);
  const auto is_stable_at = [&](double s) { return is_monotone(m, mode, s, s + small); };
  for (int i = 0; i < kStabilityPoints; ++i) {
    double low = rest + step * i, high = low + step;
    if (is_stable_at(high)) continue;
    if (i == 0 && !is_stable_at(low)) return rest;
    while (std::abs(high - low) > kDifference) {
      const double middle = (low + high) / 2;
      (is_stable_at(middle) ? low : high) = middle;
    }
    return high;
  }
  return std::nullopt;
}

// Table 1 of Dogan 2011. The source calls the tissue incompressible; K = 40 C10 is ours: Poisson's
// ratio 0.475 at once and 0.491 when relaxed.
HyperelasticMaterial human_liver() {
  return {.name = "human_liver_nava2008",
          .source = "Nava et al. 2008, aspiration in vivo; as printed in Dogan 2011 table 1",
          .coefficients_pa = {883.8, 1707.9, 1449.9, 2691.8, 1757.5},
          .bulk_modulus_pa = 40 * 883.8,
          .relaxation = {{0.5054, 0.5784}, {0.1485, 6.8863}}};
}

}  // namespace

double HyperelasticMaterial::equilibrium_share() const {
  double share = 1;
  for (const auto& term : relaxation) share -= term.weight;
  return share;
}

StrainEnergySlopes strain_energy(const HyperelasticMaterial& material, double e) {
  if (e <= 0) return {material.coefficients_pa[0] * e, material.coefficients_pa[0], 0};
  return material.energy == StrainEnergy::Exponential ? exponential(material, e)
                                                      : polynomial(material, e);
}

const char* name_of(TestMode mode) {
  switch (mode) {
    case TestMode::Uniaxial:
      return "uniaxial";
    case TestMode::Equibiaxial:
      return "equibiaxial";
    case TestMode::SimpleShear:
      return "simple shear";
  }
  return "";
}

double incompressible_stress(const HyperelasticMaterial& material, TestMode mode, double s) {
  switch (mode) {
    case TestMode::Uniaxial:
      return 2 * strain_energy(material, s * s + 2 / s - 3).first * (s - 1 / (s * s));
    case TestMode::Equibiaxial: {
      const double s4 = s * s * s * s;
      return 2 * strain_energy(material, 2 * s * s + 1 / s4 - 3).first * (s - 1 / (s4 * s));
    }
    case TestMode::SimpleShear:
      return 2 * strain_energy(material, s * s).first * s;
  }
  return 0;
}

std::optional<Instability> find_instability(const HyperelasticMaterial& material,
                                            const StabilityRange& range) {
  struct Way {
    TestMode mode;
    double rest, end;
  };
  const std::array<Way, 5> ways{{{TestMode::Uniaxial, 1, range.uniaxial_high},
                                 {TestMode::Uniaxial, 1, range.uniaxial_low},
                                 {TestMode::Equibiaxial, 1, range.equibiaxial_high},
                                 {TestMode::Equibiaxial, 1, range.equibiaxial_low},
                                 {TestMode::SimpleShear, 0, range.shear_high}}};
  std::optional<Instability> nearest;
  double nearest_strain = 0;
  for (const auto& [mode, rest, end] : ways) {
    const auto failure = first_failure(material, mode, rest, end);
    if (!failure) continue;
    const double strain = std::abs(*failure - rest);
    if (nearest && strain >= nearest_strain) continue;
    nearest = Instability{mode, *failure};
    nearest_strain = strain;
  }
  return nearest;
}

Status validate(const HyperelasticMaterial& material, const StabilityRange& range) {
  if (auto s = check_elasticity(material); !s) return s;
  if (auto s = check_relaxation(material); !s) return s;
  const auto failure = find_instability(material, range);
  if (!failure) return {};
  const bool is_shear = failure->mode == TestMode::SimpleShear;
  return wrong(material, std::string("is unstable: in ") + name_of(failure->mode) +
                             (is_shear ? " the stress falls from a shear of "
                                       : " the stress does not grow beyond a stretch of ") +
                             number(failure->stretch) + " on: use other coefficients, or fewer");
}

std::span<const HyperelasticMaterial> measured_materials() {
  static const std::vector<HyperelasticMaterial> kAll{human_liver()};
  return kAll;
}

const HyperelasticMaterial* find_measured_material(std::string_view name) {
  const auto all = measured_materials();
  const auto found = std::find_if(all.begin(), all.end(),
                                  [&](const auto& material) { return material.name == name; });
  return found == all.end() ? nullptr : &*found;
}

std::string measured_material_names() {
  std::string names;
  for (const auto& material : measured_materials())
    names += (names.empty() ? "" : ", ") + material.name;
  return names;
}

}  // namespace trocar::material
