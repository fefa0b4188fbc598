#pragma once

// The liver after deploy/scenes/eight-cuts.toml, as a client gets it: made once, by the simulation.

#include <vector>

#include "client/shape/smooth_surface.h"
#include "common/wire/surface_layout.h"

namespace trocar::testing {

struct CutLiver {
  wire::SurfaceLayout layout;
  std::vector<Vec3f> rest, positions;  // m
  std::vector<shape::TriangleCorners> triangles;
};

const CutLiver& cut_liver();

}  // namespace trocar::testing
