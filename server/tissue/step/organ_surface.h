#pragma once

// The surface that an organ's stream begins with, before any cut.

#include "common/wire/surface_layout.h"
#include "server/organs/organ/organ.h"

namespace trocar::step {

inline wire::SurfaceLayout make_surface_layout(const organ::Organ& organ) {
  return wire::make_surface_layout({.rest_positions_m = organ.mesh.rest_positions,
                                    .surface_nodes = organ.mesh.surface_nodes,
                                    .triangles = organ.mesh.boundary_triangles,
                                    .fixed_nodes = organ.fixed_nodes});
}

}  // namespace trocar::step
