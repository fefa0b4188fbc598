#pragma once

#include "common/scene/organ.h"

namespace trocar::scenario {

// The organ as it is to loads that have been there for long: of the bracket of measured tissue only
// what never relaxes is left, and nothing relaxes any more.
scene::Organ relaxed_organ(scene::Organ organ);

}  // namespace trocar::scenario
