#include "server/organs/material/material.h"

namespace trocar::material {

LameParameters lame_parameters(const Material& m) {
  const double nu = m.poisson_ratio;
  return {m.young_modulus_pa * nu / ((1 + nu) * (1 - 2 * nu)), m.young_modulus_pa / (2 * (1 + nu))};
}

void use_measured(const HyperelasticMaterial& measured, Material& material) {
  material.elastic_law = ElasticLaw::Measured;
  material.measured = measured;
  const double mu = 2 * measured.coefficients_pa[0], k = measured.bulk_modulus_pa;
  material.young_modulus_pa = mu * (3 * k - mu) / k;
  material.poisson_ratio = (k - mu) / (2 * k);
}

NeoHookeanParameters neo_hookean_parameters(const Material& material) {
  if (material.elastic_law == ElasticLaw::Measured)
    return {material.measured.coefficients_pa[0], material.measured.bulk_modulus_pa};
  const auto [lambda, mu] = lame_parameters(material);
  return {mu / 2, lambda + mu};
}

}  // namespace trocar::material
