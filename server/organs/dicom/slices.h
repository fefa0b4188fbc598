#pragma once

// Slices of a scan, each with its place in the patient, and the grid that they form.

#include <optional>
#include <vector>

#include "common/base/result.h"
#include "common/math/vec3.h"

namespace trocar::dicom {

struct SliceGrid {
  Vec3d origin, step;                // of the lowest slice, and from slice to slice
  int count = 0;                     // slices, with those that are missing
  std::vector<int> slice_of_places;  // for each place
};

// places: of the first pixel of each slice, several may be at the same; right, down: steps between
// pixels; all in mm. spacing: between slices, if it is known. Between slices that are there, others
// may be missing only where `may_miss` is set, and at most 16 for each that is there.
// Errors: no place, slices that are not above one another or not equally far apart, a slice that is
// missing or too many.
Result<SliceGrid> arrange_slices(const std::vector<Vec3d>& places, const Vec3d& right,
                                 const Vec3d& down, std::optional<double> spacing, bool may_miss);

}  // namespace trocar::dicom
