#include "server/organs/surface/signed_distance.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace trocar::surface {

SignedDistance::SignedDistance(const ClosedSurface& surface)
    : surface_(surface), tree_(surface.positions, surface.triangles) {
  const auto& triangles = surface.triangles;
  normals_.resize(triangles.size());
  edge_normals_.resize(triangles.size());
  corner_normals_.resize(surface.positions.size());
  std::vector<std::tuple<NodeIndex, NodeIndex, std::uint32_t, std::uint8_t>> edges;
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    std::array<Vec3d, 3> p;
    for (std::size_t i = 0; i < 3; ++i) p[i] = surface.positions[triangles[t][i].value];
    normals_[t] = normalized(cross(p[1] - p[0], p[2] - p[0]), {});
    for (std::uint8_t i = 0; i < 3; ++i) {
      const Vec3d u = normalized(p[(i + 1) % 3] - p[i], {}),
                  v = normalized(p[(i + 2) % 3] - p[i], {});
      const double angle = std::acos(std::clamp(dot(u, v), -1.0, 1.0));
      corner_normals_[triangles[t][i].value] += normals_[t] * angle;
      const NodeIndex a = triangles[t][i], b = triangles[t][(i + 1u) % 3];
      edges.emplace_back(std::min(a, b), std::max(a, b), t, i);
    }
  }
  // Each edge has two triangles.
  std::sort(edges.begin(), edges.end());
  for (std::size_t e = 0; e + 1 < edges.size(); e += 2) {
    const auto [a, b, t, i] = edges[e];
    const auto [c, d, u, j] = edges[e + 1];
    const Vec3d sum = normals_[t] + normals_[u];
    edge_normals_[t][i] = sum;
    edge_normals_[u][j] = sum;
  }
}

double SignedDistance::operator()(const Vec3d& p) const {
  const NearestPoint nearest = tree_.nearest(p);
  const auto corner = static_cast<std::size_t>(nearest.corner);
  const Vec3d& normal = nearest.part == NearestPoint::Part::Inside ? normals_[nearest.triangle]
                        : nearest.part == NearestPoint::Part::Edge
                            ? edge_normals_[nearest.triangle][corner]
                            : corner_normals_[surface_.triangles[nearest.triangle][corner].value];
  const double distance = std::sqrt(nearest.distance_squared);
  return dot(p - nearest.point, normal) < 0 ? -distance : distance;
}

}  // namespace trocar::surface
