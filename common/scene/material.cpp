#include "common/scene/material.h"

namespace trocar::scene {

LameParameters lame_parameters(const Material& m) {
  const double nu = m.poisson_ratio;
  return {m.young_modulus_pa * nu / ((1 + nu) * (1 - 2 * nu)), m.young_modulus_pa / (2 * (1 + nu))};
}

NeoHookeanParameters neo_hookean_parameters(const Material& material) {
  const auto [lambda, mu] = lame_parameters(material);
  return {mu / 2, lambda + mu};
}

}  // namespace trocar::scene
