#pragma once

// Organs that only experiments need.

#include "common/base/result.h"
#include "common/scene/builtin_organs.h"

namespace trocar::validation {

// Choi's lattice with springs along the diagonals of the cells' faces too, as stiff as the others:
// without them it has no shear stiffness, and with them (100 and 110 springs of one k) Poisson's
// ratio is 1/4 and E = 5 k / (2 spacing).
scene::Organ lattice_with_diagonals(const scene::LatticeSize& size);

}  // namespace trocar::validation
