#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/math/vec3.h"

namespace trocar {

// Bits of the low 21 of each interleaved, x lowest: the place of a cell along a Morton curve.
std::uint64_t morton_code(std::uint64_t x, std::uint64_t y, std::uint64_t z);

// Order of points along a Morton curve; ties by index. Returns for each place in the order the
// index into `points`. Neighbours in space become neighbours in the order.
std::vector<std::uint32_t> morton_order(std::span<const Vec3d> points);

}  // namespace trocar
