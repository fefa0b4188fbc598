#pragma once

#include "server/organs/organ/organ.h"

namespace trocar::scenario {

// The organ as it is to loads that have been there for long: of the bracket of measured tissue only
// what never relaxes is left, and nothing relaxes any more.
organ::Organ relaxed_organ(organ::Organ organ);

}  // namespace trocar::scenario
