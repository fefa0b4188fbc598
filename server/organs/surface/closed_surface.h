#pragma once

// A closed surface is made of the triangles of a file.
//
// check_surface() repairs what can only have been meant one way, and says so in `warnings`: it
// welds vertices at exactly the same place, drops triangles without three corners, those listed
// twice, and vertices that nothing uses, turns triangles whose corners are listed in mirrored
// order, and drops bodies that together have less than 1 % of the volume. It rejects, naming the
// place by the file's own numbers: surfaces that are open, edges of three triangles or more,
// surfaces of one side, ones that pass through themselves, several bodies, and solids larger than 2
// m. All in double precision; the result is centred on the origin before anything is measured.
//
// Shells inside others bound cavities: those at odd depth face inward. Where the file has one that
// faces as the shell around it does, a warning says so: it may have been meant as a solid.

#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/organs/mesh/raw_tets.h"
#include "server/organs/surface/raw_surface.h"

namespace trocar::surface {

struct ClosedSurface {
  std::vector<Vec3d> positions;           // m, bounding box centred on the origin
  std::vector<mesh::Triangle> triangles;  // counter-clockwise seen from outside the tissue
  Vec3d offset_m;                         // add to a position to get the file's place
  double volume_m3 = 0;                   // enclosed, above 0
  double area_m2 = 0;
  std::size_t cavities = 0;           // shells inside
  std::vector<std::string> warnings;  // one line each: what was repaired, and how often
};

// `name` starts each error, usually the file's path.
Result<ClosedSurface> check_surface(RawSurface raw, mesh::Unit unit, const std::string& name);

}  // namespace trocar::surface
