#pragma once

// Organs of few nodes for tests of reduced models.

#include "server/organs/organ/local_reduction.h"

namespace trocar::reduce::testing {

// A block of cells of 10 mm of the measured liver, whose lowest layer in y is held; centred.
organ::Organ block(int nx, int ny, int nz);

// A local reduction of the block that validate() accepts, of two patches at opposite corners of its
// upper side; modes, Green's functions and matrices of no meaning. Needs a block of 18 nodes or
// more.
organ::LocalReduction synthetic_local_reduction(const organ::Organ& organ);

}  // namespace trocar::reduce::testing
