#include "client/haptics/power_law.h"

#include <cmath>

namespace trocar::haptics {
namespace {

constexpr double kStartDepth_m = 0.005;

}  // namespace

double PowerLaw::force_n(double depth_m) const {
  if (depth_m <= 0) return 0;
  if (depth_m < kLinearDepth_m) return stiffness_n_m(depth_m) * depth_m;
  return coefficient * std::pow(depth_m, exponent);
}

double PowerLaw::stiffness_n_m(double depth_m) const {
  if (depth_m < kLinearDepth_m) return coefficient * std::pow(kLinearDepth_m, exponent - 1);
  return coefficient * exponent * std::pow(depth_m, exponent - 1);
}

PowerLaw first_guess(const wire::HapticLaw& law, double tip_radius_m) {
  const double nu = law.poisson_ratio;
  const double plane_modulus_pa = law.youngs_modulus_pa / (1 - nu * nu);
  const double stiffness_n_m = 2 * plane_modulus_pa * std::sqrt(tip_radius_m * kStartDepth_m);
  const double p = law.exponent;
  return {stiffness_n_m / (p * std::pow(kStartDepth_m, p - 1)), p};
}

}  // namespace trocar::haptics
