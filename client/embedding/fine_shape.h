#pragma once

// A fine surface of the wire, as what is embedded takes it.

#include "client/embedding/embedded_surface.h"
#include "common/wire/fine_surface.h"

namespace trocar::embedding {

// Places in the picture are of its first row at 0, as pictures are unpacked.
FineShape shape_of(const wire::FineSurface& fine);

}  // namespace trocar::embedding
