#pragma once

// How much of the surface a film of blood hides, the same in the window and on the page.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "client/shape/smooth_surface.h"

namespace trocar::shape {

// This depth of blood hides all but a share of 1/e of what is below it.
inline constexpr float kCoveringMetres = 60e-6f;

// Returns the share that a film of `depth_m` hides, 0 to 1, by the law of Beer and Lambert.
float cover_of(float depth_m);

// Fills `covers`, a share per vertex of `surface`. `levels`: depth at each coarse vertex in steps
// of `level_m`; of another size (a session that does not bleed): nothing is covered.
void cover_with_blood(const SmoothSurface& surface, std::span<const float> levels, float level_m,
                      std::vector<float>& covers);

// Returns what the organ's shader takes as `lip`, in bytes that stand for -1 to 1: a unit vector,
// and how much blood covers.
std::array<std::int8_t, 4> lip_bytes(const Vec3f& lip, float cover);

}  // namespace trocar::shape
