#pragma once

// A block of tets for scenarios: the specimen of a testing machine, a bar, a beam.

#include "common/base/result.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/organ/organ.h"

namespace trocar::scenario {

// Nodes as in a lattice; each cube between them is cut into six tets around the diagonal from its
// lowest to its highest corner, so that faces of neighbours fit. The lowest layer in y is fixed.
Result<organ::Organ> make_block(const catalogue::LatticeSize& size);

}  // namespace trocar::scenario
