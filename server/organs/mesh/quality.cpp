#include "server/organs/mesh/quality.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trocar::mesh {

std::array<std::size_t, kDihedralClasses> dihedral_histogram(const TetMesh& mesh) {
  constexpr std::size_t kOutwardFaces[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
  std::array<std::size_t, kDihedralClasses> counts{};
  for (const Tet& tet : mesh.tets) {
    std::array<Vec3d, 4> normals;  // outward, of length 1
    for (std::size_t f = 0; f < 4; ++f) {
      const Vec3d& o = mesh.rest_positions[tet[kOutwardFaces[f][0]].value];
      normals[f] = normalized(cross(mesh.rest_positions[tet[kOutwardFaces[f][1]].value] - o,
                                    mesh.rest_positions[tet[kOutwardFaces[f][2]].value] - o),
                              Vec3d{});
    }
    // The angle inside between two faces is 180 degrees less the angle between outward normals.
    double largest_cosine = -1;
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = 0; j < i; ++j)
        largest_cosine = std::max(largest_cosine, -dot(normals[i], normals[j]));
    const double angle = std::acos(std::clamp(largest_cosine, -1.0, 1.0)) * 180 / std::numbers::pi;
    ++counts[std::min(static_cast<std::size_t>(angle / 10), kDihedralClasses - 1)];
  }
  return counts;
}

}  // namespace trocar::mesh
