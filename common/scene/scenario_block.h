#pragma once

// A block of tets for scenarios: the specimen of a testing machine, a bar, a beam.

#include "common/base/result.h"
#include "common/scene/builtin_organs.h"
#include "common/scene/organ.h"

namespace trocar::scene {

// Nodes as in a lattice; each cube between them is cut into six tets around the diagonal from its
// lowest to its highest corner, so that faces of neighbours fit. The lowest layer in y is fixed.
Result<Organ> make_block(const LatticeSize& size);

}  // namespace trocar::scene
