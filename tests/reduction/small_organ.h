#pragma once

// Organs of few nodes for tests of reduced models.

#include "common/scene/local_reduction.h"

namespace trocar::reduction::testing {

// A block of cells of 10 mm of the measured liver, whose lowest layer in y is held; centred.
scene::Organ block(int nx, int ny, int nz);

// A reduction of the block that validate() accepts, with modes and creep of no meaning.
scene::Reduction synthetic_reduction(const scene::Organ& organ, std::size_t modes);

// A local one of the block, of two patches at opposite corners of its upper side; modes, Green's
// functions and matrices of no meaning. Needs a block of 18 nodes or more.
scene::LocalReduction synthetic_local_reduction(const scene::Organ& organ);

}  // namespace trocar::reduction::testing
