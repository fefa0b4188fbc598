#pragma once

#include "server/papers/dogan/reduction.h"

namespace trocar::dogan::testing {

// A reduction of the organ that validate() accepts; its modes and creep mean nothing.
Reduction synthetic_reduction(const organ::Organ& organ, std::size_t modes);

}  // namespace trocar::dogan::testing
