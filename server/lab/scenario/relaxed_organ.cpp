#include "server/lab/scenario/relaxed_organ.h"

namespace trocar::scenario {
namespace {

// The bracket is linear in its coefficients.
void relax(material::Material& material) {
  if (material.elastic_law != material::ElasticLaw::Measured) return;
  auto& law = material.measured;
  const double share = law.equilibrium_share();
  for (double& c : law.coefficients_pa) c *= share;
  law.relaxation.clear();
}

}  // namespace

organ::Organ relaxed_organ(organ::Organ organ) {
  relax(organ.material);
  for (auto& region : organ.regions) relax(region.material);
  return organ;
}

}  // namespace trocar::scenario
