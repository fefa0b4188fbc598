#include "server/dynamics/tet_shape.h"

namespace trocar::dynamics {

TetShape tet_shape(std::span<const Vec3d> positions, const mesh::Tet& tet) {
  const auto at = [&](std::size_t i) { return positions[tet[i].value]; };
  const Vec3d ab = at(1) - at(0), ac = at(2) - at(0), ad = at(3) - at(0);
  const double six_volumes = dot(cross(ab, ac), ad);
  TetShape shape;
  shape.volume = six_volumes / 6;
  shape.gradients[1] = cross(ac, ad) / six_volumes;
  shape.gradients[2] = cross(ad, ab) / six_volumes;
  shape.gradients[3] = cross(ab, ac) / six_volumes;
  shape.gradients[0] = -(shape.gradients[1] + shape.gradients[2] + shape.gradients[3]);
  return shape;
}

}  // namespace trocar::dynamics
