#pragma once

#include "server/papers/reduction/reduction.h"

namespace trocar::reduction::testing {

// A block of cells of 10 mm of the measured liver, whose lowest layer in y is held; centred.
organ::Organ block(int nx, int ny, int nz);

// A reduction of the organ that validate() accepts; its modes and creep mean nothing.
Reduction synthetic_reduction(const organ::Organ& organ, std::size_t modes);

}  // namespace trocar::reduction::testing
