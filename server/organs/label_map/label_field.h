#pragma once

// A field says which label holds at a place between voxels: the steps of the voxels are rounded
// off.
//
// Each label's share at a place is the mean over the 27 voxels around it, weighted by quadratic
// B-splines along each axis; the largest share holds, the lowest label of equal ones. A plane
// between voxels stays where it is; a tube one voxel thick stays a tube. Beyond the solid the
// nearest label goes on, so that interfaces go on through its surface.
//
// Source: Unser: Splines, a perfect fit for signal and image processing, IEEE Signal Processing
// Magazine 16(6), 1999, for the weights.

#include <cstdint>
#include <vector>

#include "server/organs/label_map/label_solid.h"

namespace trocar::label_map {

// The solid must outlive it. Takes two bytes a voxel, and four for each at the surface. A const one
// may be used by any thread.
class LabelField {
 public:
  explicit LabelField(const LabelSolid& solid);

  std::uint16_t operator()(const Vec3d& p) const;  // m, in the map's frame; never 0

 private:
  const LabelMap& map_;
  std::vector<std::uint16_t> labels_;  // one a voxel, none 0
};

}  // namespace trocar::label_map
