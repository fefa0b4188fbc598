#pragma once

#include "common/wire/surface_layout.h"
#include "server/organs/organ/organ.h"

namespace trocar::world {

// The layout in which the surface of an uncut organ is streamed.
wire::SurfaceLayout make_surface_layout(const organ::Organ& organ);

}  // namespace trocar::world
