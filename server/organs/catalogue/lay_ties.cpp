#include "server/organs/catalogue/lay_ties.h"

#include <algorithm>
#include <cmath>

#include "server/organs/surface/triangle_tree.h"

namespace trocar::catalogue {
namespace {

// The surface looks towards the other one if the cosine to it is at least this.
constexpr double kLeastCosine = 0.3;
// An area that is met but for rounding is met.
constexpr double kRounding = 1e-9;
// Places that are so near have no direction between them.
constexpr double kTouching_m = 1e-5;

std::vector<TriangleIndex> triangles_in(const mesh::TetMesh& mesh,
                                        const std::vector<NodeIndex>& nodes) {
  std::vector<TriangleIndex> found;
  for (std::size_t t = 0; t < mesh.boundary_triangles.size(); ++t)
    if (std::ranges::binary_search(nodes, mesh.boundary_triangles[t][0])) found.emplace_back(t);
  return found;
}

std::array<double, 3> weights_of(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const Vec3d u = b - a, v = c - a, n = cross(u, v), w = p - a;
  const double squared = length_squared(n);
  const double y = std::max(0.0, dot(cross(w, v), n) / squared);
  const double z = std::max(0.0, dot(cross(u, w), n) / squared);
  const double x = std::max(0.0, 1 - y - z), sum = x + y + z;
  return {x / sum, y / sum, z / sum};
}

// Calls visit with the middle of each small triangle, by its weights.
template <typename Visit>
void for_each_middle(int rows, Visit&& visit) {
  for (int i = 0; i < rows; ++i)
    for (int j = 0; i + j < rows; ++j)
      for (int up = 0; up < (i + j + 1 < rows ? 2 : 1); ++up) {
        const double third = up != 0 ? 2.0 / 3 : 1.0 / 3;
        const double y = (i + third) / rows, z = (j + third) / rows;
        visit({1 - y - z, y, z});
      }
}

}  // namespace

std::vector<organ::Tie> lay_ties(const mesh::TetMesh& mesh, const std::vector<NodeIndex>& first,
                                 const std::vector<NodeIndex>& second, double within_m,
                                 double area_m2) {
  const auto others = triangles_in(mesh, second);
  std::vector<mesh::Triangle> there;
  for (const auto t : others) there.push_back(mesh.boundary_triangles[t.value]);
  const surface::TriangleTree tree(mesh.rest_positions, there);
  const auto at = [&](NodeIndex node) { return mesh.rest_positions[node.value]; };
  std::vector<organ::Tie> ties;
  for (const auto t : triangles_in(mesh, first)) {
    const auto& [a, b, c] = mesh.boundary_triangles[t.value];
    const Vec3d normal = cross(at(b) - at(a), at(c) - at(a));
    const double area = length(normal) / 2;
    const int rows =
        std::max(1, static_cast<int>(std::ceil(std::sqrt(area / area_m2) * (1 - kRounding))));
    for_each_middle(rows, [&, a = a, b = b, c = c](const std::array<double, 3>& weights) {
      const Vec3d place = at(a) * weights[0] + at(b) * weights[1] + at(c) * weights[2];
      const auto nearest = tree.nearest(place);
      const double distance = std::sqrt(nearest.distance_squared);
      if (distance > within_m) return;
      const Vec3d way = nearest.point - place;
      if (distance > kTouching_m && dot(way, normal) < kLeastCosine * distance * 2 * area) return;
      const auto& [d, e, f] = there[nearest.triangle];
      organ::Tie tie;
      tie.ends[0] = {t, weights};
      tie.ends[1] = {others[nearest.triangle], weights_of(nearest.point, at(d), at(e), at(f))};
      tie.area_m2 = area / (rows * rows);
      ties.push_back(tie);
    });
  }
  return ties;
}

}  // namespace trocar::catalogue
