#include "server/tissue/topology/tet_shape.h"

namespace trocar::topology {

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

namespace {

// f (f . v) for f of length 1; fibres: of any.
Vec3d along_fibres(const Vec3d& fibres, const Vec3d& v) {
  const double squared = length_squared(fibres);
  return squared > 0 ? fibres * (dot(fibres, v) / squared) : Vec3d{};
}

}  // namespace

Vec3d relaxed(const material::Material& material, const Vec3d& fibres, const Vec3d& vector) {
  return vector * (1 - material.tension) - along_fibres(fibres, vector) * material.fibre_tension;
}

// Gradients go by the inverse of the stretch (Sherman and Morrison's formula).
TetShape stress_free_shape(const Topology& topology, TetIndex tet, const mesh::Tet& corners) {
  auto shape = tet_shape(topology.stress_free(), corners);
  const auto& m = organ::material_at(topology.organ(), topology.material_of(tet));
  const Vec3d fibres = organ::fibres_in(m, topology.fibre_axis(tet));
  const double fibre_tension = length_squared(fibres) > 0 ? m.fibre_tension : 0;
  if (m.tension == 0 && fibre_tension == 0) return shape;
  const double across = 1 - m.tension, along = across - fibre_tension;
  shape.volume *= across * across * along;
  for (auto& g : shape.gradients)
    g = (g + along_fibres(fibres, g) * (fibre_tension / along)) / across;
  return shape;
}

}  // namespace trocar::topology
