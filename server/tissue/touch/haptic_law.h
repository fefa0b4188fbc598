#pragma once

#include <vector>

#include "common/wire/haptic_patch.h"
#include "server/organs/organ/organ.h"

namespace trocar::touch {

// How each material of the organ answers a tool over time: number i is that of
// organ::material_at(organ, i).
std::vector<wire::HapticLaw> haptic_laws(const organ::Organ& organ);

// Hertz: the stiffness at a depth of a sphere of that radius pressed into a half space, N/m.
float hertz_stiffness_n_m(const wire::HapticLaw& law, float radius_m, float depth_m);

// Reissner: the stiffness of a shallow spherical shell of that thickness under a point load, N/m
// (Reissner 1946, J. Math. Phys. 25). A wall that is nearly flat has a rim somewhere.
float wall_stiffness_n_m(const wire::HapticLaw& law, float thickness_m, float curvature);

}  // namespace trocar::touch
