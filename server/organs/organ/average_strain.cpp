#include "server/organs/organ/average_strain.h"

#include "server/organs/organ/any_material.h"

namespace trocar::organ {

Status average_strain(Organ& organ) {
  if (!any_material(organ, material::is_hyperelastic))
    return Error{ErrorCode::Usage,
                 "averaged strain: is of neo-hookean and measured tets, " + organ.name +
                     " has none; name liver or elastic-liver, or make it with --material"};
  organ.material.has_averaged_strain = material::is_hyperelastic(organ.material);
  for (auto& region : organ.regions)
    region.material.has_averaged_strain = material::is_hyperelastic(region.material);
  return {};
}

void use_plain_strain(Organ& organ) {
  organ.material.has_averaged_strain = false;
  for (auto& region : organ.regions) region.material.has_averaged_strain = false;
}

}  // namespace trocar::organ
