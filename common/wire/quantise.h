#pragma once

// Displacements of surface vertices as integers on a 32 um grid. Server, clients and journal agree
// on these integers bit for bit, so deltas are integer differences and nothing drifts.

#include <cstdint>
#include <span>
#include <vector>

#include "common/math/vec3.h"

namespace trocar::wire {

inline constexpr float kQuantumMetres = 32e-6f;
// |displacement| <= 1 m; a vertex farther from rest is clamped (later: retired into a body).
inline constexpr std::int32_t kMaxQuanta = 31250;
// A vertex keeps its integer until the true value is this many quanta away from it: slow vertices
// do not flicker. 0.5 would be plain rounding. Measured in network-and-recording: 0.75.
inline constexpr float kHysteresisQuanta = 0.75f;

using QuantisedVertex = Vec3<std::int32_t>;
using QuantisedSurface = std::vector<QuantisedVertex>;  // displacement from rest, one per slot

// Updates `quantised[i]` from `displacements_m[i]` with hysteresis per component. Sizes are equal.
void quantise(std::span<const Vec3f> displacements_m, std::span<QuantisedVertex> quantised);

inline Vec3f to_metres(const QuantisedVertex& v) {
  return {static_cast<float>(v.x) * kQuantumMetres, static_cast<float>(v.y) * kQuantumMetres,
          static_cast<float>(v.z) * kQuantumMetres};
}

// Rest positions rounded to the grid (no hysteresis, no clamp).
std::vector<QuantisedVertex> quantise_rest(std::span<const Vec3d> rest_positions_m);

// CRC-32 over the integers as they lie in memory (little-endian int32 x, y, z per vertex).
std::uint32_t surface_crc(std::span<const QuantisedVertex> surface);

}  // namespace trocar::wire
