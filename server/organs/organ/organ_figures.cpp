#include "server/organs/organ/organ_figures.h"

#include <algorithm>
#include <numeric>

namespace trocar::organ {

double enclosed_volume(const mesh::TetMesh& mesh) {
  double volume = 0;
  for (const auto& [a, b, c] : mesh.boundary_triangles)
    volume += dot(cross(mesh.rest_positions[a.value], mesh.rest_positions[b.value]),
                  mesh.rest_positions[c.value]) /
              6;
  return volume;
}

Vec3d size_of(const mesh::TetMesh& mesh) {
  Vec3d half{};  // the rest bounding box is centred on the origin
  for (const Vec3d& p : mesh.rest_positions)
    half = {std::max(half.x, p.x), std::max(half.y, p.y), std::max(half.z, p.z)};
  return half * 2.0;
}

double mass_kg(const Organ& organ) {
  return std::accumulate(organ.node_masses_kg.begin(), organ.node_masses_kg.end(), 0.0);
}

}  // namespace trocar::organ
