#include "client/render/smooth_surface.h"

#include <algorithm>
#include <map>
#include <utility>

namespace trocar::render {

void compute_normals(std::span<const Vec3f> positions, std::span<const TriangleCorners> triangles,
                     std::vector<Vec3f>& normals) {
  normals.assign(positions.size(), Vec3f{});
  for (const auto& [a, b, c] : triangles) {
    // Twice the area long, so that the sum is weighted by area.
    const Vec3f n = cross(positions[b] - positions[a], positions[c] - positions[a]);
    normals[a] += n;
    normals[b] += n;
    normals[c] += n;
  }
  for (Vec3f& n : normals) n = normalized(n * 1e6f, Vec3f{0, 1, 0});
}

SmoothSurface::SmoothSurface(std::size_t vertex_count, std::span<const TriangleCorners> triangles,
                             std::size_t triangle_budget)
    : coarse_vertex_count_(vertex_count),
      coarse_triangles_(triangles.begin(), triangles.end()),
      fine_triangles_(coarse_triangles_) {
  for (int level = 0; level < 2 && fine_triangles_.size() * 4 <= triangle_budget; ++level) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> midpoint_of_edge;
    const auto midpoint = [&](std::uint32_t a, std::uint32_t b) {
      const auto next = static_cast<std::uint32_t>(coarse_vertex_count_ + midpoints_.size());
      const auto [found, is_new] = midpoint_of_edge.try_emplace(std::minmax(a, b), next);
      if (is_new) midpoints_.push_back({a, b});
      return found->second;
    };
    std::vector<TriangleCorners> finer;
    finer.reserve(fine_triangles_.size() * 4);
    for (const auto& [a, b, c] : fine_triangles_) {
      const std::uint32_t ab = midpoint(a, b), bc = midpoint(b, c), ca = midpoint(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    fine_triangles_ = std::move(finer);
  }
}

void SmoothSurface::update(std::span<const Vec3f> coarse_positions) {
  positions_.assign(coarse_positions.begin(), coarse_positions.end());
  compute_normals(positions_, coarse_triangles_, normals_);
  positions_.reserve(vertex_count());
  normals_.reserve(vertex_count());
  for (const auto& [a, b] : midpoints_) {
    const Vec3f edge = positions_[b] - positions_[a];
    const float bend_a = dot(edge, normals_[a]), bend_b = -dot(edge, normals_[b]);
    positions_.push_back((positions_[a] + positions_[b]) * 0.5f -
                         (normals_[a] * bend_a + normals_[b] * bend_b) * 0.125f);
    normals_.push_back(normalized(normals_[a] + normals_[b], normals_[a]));
  }
}

}  // namespace trocar::render
