#pragma once

#include "common/scene/organ.h"

namespace trocar::scene {

// Material::has_averaged_strain in all of the organ's hyperelastic tissue. Error: it has none.
Status average_strain(Organ& organ);

}  // namespace trocar::scene
