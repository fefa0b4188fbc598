#pragma once

// The liver after deploy/scenes/eight-cuts.toml, as a client gets it: made once, by the simulation.

#include <functional>
#include <vector>

#include "client/shape/smooth_surface.h"
#include "common/wire/surface_layout.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::testing {

struct CutLiver {
  wire::SurfaceLayout layout;
  std::vector<Vec3f> rest, positions;  // m
  std::vector<shape::TriangleCorners> triangles;
};

// Operates on the liver by that script, and calls `visit` with each frame and its layout.
using Visit = std::function<void(const wire::SurfaceLayout&, const step::PublishedFrame&)>;
void operate_on_liver(const Visit& visit);

const CutLiver& cut_liver();

}  // namespace trocar::testing
