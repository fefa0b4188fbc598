#pragma once

// Keeps the eye that a picture is drawn from out of the tissue, so that nobody looks at the backs
// of walls, and finds where the near plane may lie so that it cuts no wall away.
//
//   eye - back * forward is outside, and no tissue is nearer to it than is asked for
//
// Outside is where the surface winds around nothing. Going back along the axis leads there from
// any place, in a wound as in the hollow of a stomach. Cost: linear in the triangles, with a small
// factor; only those near the axis are looked at closely. Thread: render thread.

#include <span>

#include "client/shape/smooth_surface.h"
#include "common/math/vec3.h"

namespace trocar::shape {

// No tissue comes nearer to an eye, and to the end of an endoscope, which sees nothing that touches
// it. What is drawn bulges from the triangles by less than half.
inline constexpr float kClearMetres = 0.0015f, kScopeClearMetres = 0.0035f;
// It is looked for as far away as this.
inline constexpr float kLookMetres = 0.04f;

struct ClearEye {
  float back_m = 0;     // the eye has to step back by so much, against its direction
  float nearest_m = 0;  // from there the nearest tissue is so far away; at most kLookMetres
};

// `forward` is of unit length. The surface is closed; triangles with equal corners are left out.
// `clear_m`: tissue stays so far away, more than 0 and less than kLookMetres.
ClearEye clear_eye(const Vec3f& eye, const Vec3f& forward, std::span<const Vec3f> positions,
                   std::span<const TriangleCorners> triangles, float clear_m);

// Returns the near plane's distance, m, for a picture of this shape: no corner of it is farther
// from the eye than `nearest_m`.
float near_plane(float nearest_m, float tan_half_height, float aspect);

}  // namespace trocar::shape
