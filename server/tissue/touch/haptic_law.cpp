#include "server/tissue/touch/haptic_law.h"

#include <algorithm>
#include <cmath>

namespace trocar::touch {
namespace {

// A palpated liver of measured material showed this: the force grows with this power of the depth,
// and tissue that gives way slowly adds these shares of the stiffness at once.
constexpr float kExponent = 1.3f;
constexpr wire::HapticLaw::Term kFast[] = {{1.2f, 0.002f}, {0.4f, 0.010f}};

constexpr float kLeastCurvature = 10;  // 1/m

}  // namespace

std::vector<wire::HapticLaw> haptic_laws(const organ::Organ& organ) {
  std::vector<wire::HapticLaw> laws;
  for (std::size_t i = 0; i <= organ.regions.size(); ++i) {
    const auto& material = organ::material_at(organ, static_cast<std::uint16_t>(i));
    wire::HapticLaw law{.number = static_cast<std::uint32_t>(i)};
    law.exponent = kExponent;
    law.youngs_modulus_pa = static_cast<float>(std::clamp(material.young_modulus_pa, 1.0, 1e9));
    law.poisson_ratio = static_cast<float>(std::clamp(material.poisson_ratio, 0.0, 0.5));
    std::ranges::copy(kFast, law.fast.begin());
    if (material.elastic_law == material::ElasticLaw::Measured) {
      const auto& terms = material.measured.relaxation;
      for (std::size_t k = 0; k < std::min(terms.size(), law.relaxation.size()); ++k)
        law.relaxation[k] = {static_cast<float>(terms[k].weight),
                             static_cast<float>(terms[k].relaxation_time_s)};
    }
    laws.push_back(law);
  }
  return laws;
}

float hertz_stiffness_n_m(const wire::HapticLaw& law, float radius_m, float depth_m) {
  const float modulus = law.youngs_modulus_pa / (1 - law.poisson_ratio * law.poisson_ratio);
  return 2 * modulus * std::sqrt(radius_m * std::max(depth_m, 0.0f));
}

float wall_stiffness_n_m(const wire::HapticLaw& law, float thickness_m, float curvature) {
  const float nu = law.poisson_ratio;
  const float bends = std::max(kLeastCurvature, std::abs(curvature));
  return 8 * law.youngs_modulus_pa * thickness_m * thickness_m * bends /
         std::sqrt(12 * (1 - nu * nu));
}

}  // namespace trocar::touch
