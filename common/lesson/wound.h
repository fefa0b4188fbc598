#pragma once

// Wounds and free pieces are measured here, on the surface at rest.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/lesson/lesson.h"
#include "common/wire/surface_layout.h"

namespace trocar::lesson {

// A line on the surface, cut into cells of about 2 mm. "Deep" is towards the organ's centre.
struct Incision {
  double covered = 0;   // part of the line that is cut to the depth within the tolerance, 0 to 1
  double error_m = 0;   // of the wound within the tolerance: mean distance to the line, by area
  double stray_m2 = 0;  // wound farther away
};
Incision measure_incision(const wire::SurfaceLayout& layout, std::span<const Vec3d> line_m,
                          double depth_m, double tolerance_m);

// A piece that is not fixed and shares no vertex with the rest, with a structure's centre in it.
struct Specimen {
  double volume_m3 = 0;
  double margin_m = 0;  // least distance of its wound from the structure, negative: it was cut into
};
std::optional<Specimen> find_specimen(const wire::SurfaceLayout& layout,
                                      const Structure& structure);

// Wound within a structure, m^2; both sides of a cut count.
double wound_within_m2(const wire::SurfaceLayout& layout, const Structure& structure);

}  // namespace trocar::lesson
