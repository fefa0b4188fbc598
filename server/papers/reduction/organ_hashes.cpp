#include "server/papers/reduction/organ_hashes.h"

#include "common/base/hash_array.h"

namespace trocar::reduction {
namespace {

std::vector<double> elasticity_of(const material::Material& m) {
  std::vector<double> numbers{static_cast<double>(m.elastic_law), m.tension, m.fibre_tension};
  if (m.elastic_law != material::ElasticLaw::Measured) {
    const auto [c10_pa, bulk_modulus_pa] = material::neo_hookean_parameters(m);
    numbers.insert(numbers.end(), {c10_pa, bulk_modulus_pa});
    return numbers;
  }
  const auto& law = m.measured;
  numbers.insert(numbers.end(), {static_cast<double>(law.energy), static_cast<double>(law.split),
                                 law.exponent, law.bulk_modulus_pa});
  numbers.insert(numbers.end(), law.coefficients_pa.begin(), law.coefficients_pa.end());
  for (const auto& [weight, time_s] : law.relaxation)
    numbers.insert(numbers.end(), {weight, time_s});
  return numbers;
}

}  // namespace

std::uint64_t mesh_hash(const organ::Organ& organ) {
  StateHasher hasher;
  hash_array(hasher, organ.mesh.rest_positions);
  hash_array(hasher, organ.mesh.tets);
  hash_array(hasher, organ.fixed_nodes);
  return hasher.digest();
}

std::uint64_t elasticity_hash(const organ::Organ& organ) {
  StateHasher hasher;
  hash_array(hasher, elasticity_of(organ.material));
  for (const auto& region : organ.regions) {
    hash_array(hasher, elasticity_of(region.material));
    hash_array(hasher, region.nodes);
    if (!region.tets.empty()) hash_array(hasher, region.tets);
  }
  hash_array(hasher, std::vector<Vec3d>{organ.gravity_m_s2});
  hash_array(hasher, organ.stress_free_positions_m);
  return hasher.digest();
}

}  // namespace trocar::reduction
