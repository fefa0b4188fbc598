#pragma once

// Rest geometry of one linear tet: volume and gradients of its shape functions.

#include <array>

#include "common/scene/organ.h"

namespace trocar::dynamics {

struct TetShape {
  double volume = 0;               // m^3
  std::array<Vec3d, 4> gradients;  // 1/m; they sum to zero
};
TetShape tet_shape(std::span<const Vec3d> positions, const mesh::Tet& tet);

}  // namespace trocar::dynamics
