#pragma once

#include "server/organs/organ/organ.h"

namespace trocar::organ {

// Material::has_averaged_strain in all of the organ's hyperelastic tissue. Error: it has none.
Status average_strain(Organ& organ);
// Takes it from all of the organ: plain tets.
void use_plain_strain(Organ& organ);

}  // namespace trocar::organ
