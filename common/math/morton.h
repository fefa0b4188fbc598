#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/math/vec3.h"

namespace trocar {

// Order of points along a Morton curve; ties by index. Returns for each place in the order the
// index into `points`. Neighbours in space become neighbours in the order.
std::vector<std::uint32_t> morton_order(std::span<const Vec3d> points);

}  // namespace trocar
