#pragma once

// The places of a foreign mesh's nodes, or of a surface's vertices: their size is checked, they are
// centred, and those at exactly the same place become one.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/math/vec3.h"
#include "server/organs/mesh/raw_tets.h"

namespace trocar::mesh {

struct Centring {
  Vec3d offset_m;       // by which all were moved; add it to get the file's place
  std::string warning;  // one line; empty: none
};
// Moves the middle of their bounding box to the origin. positions: m, at least one; `unit`: of the
// file, for messages; `things`: "nodes". Error: all are at one place, or farther apart than 2 m.
Result<Centring> centre(std::span<Vec3d> positions, Unit unit, const std::string& things);

struct Welding {
  std::vector<std::uint32_t> first;  // for each the lowest at the same place
  std::vector<std::uint8_t> keep;    // 0: another one is there, which is lower
  std::size_t welded = 0;            // of those
};
Welding weld(std::span<const Vec3d> positions);

}  // namespace trocar::mesh
