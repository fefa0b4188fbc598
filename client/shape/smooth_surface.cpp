#include "client/shape/smooth_surface.h"

#include <algorithm>
#include <bit>

namespace trocar::shape {

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

void SmoothSurface::EdgeTable::clear(std::size_t most_edges) {
  const std::size_t size = std::bit_ceil(std::max<std::size_t>(2 * most_edges, 16));
  slots_.assign(size, Slot{});
  shift_ = 64 - static_cast<unsigned>(std::countr_zero(size));
}

std::uint32_t& SmoothSurface::EdgeTable::at(std::uint32_t a, std::uint32_t b) {
  const std::uint64_t key = std::uint64_t{std::min(a, b)} << 32 | std::max(a, b);
  // This is Fibonacci hashing (Knuth vol. 3, 6.4).
  std::size_t i = static_cast<std::size_t>(key * 0x9e3779b97f4a7c15u >> shift_);
  while (slots_[i].key != key && slots_[i].key != kEmpty) i = (i + 1) & (slots_.size() - 1);
  slots_[i].key = key;
  return slots_[i].value;
}

// Outer triangles as they are, then the wound's with their own copies of rim vertices.
void SmoothSurface::split_rim(std::span<const TriangleCorners> triangles,
                              std::span<const std::uint8_t> is_wound) {
  coarse_triangles_.clear();
  wound_of_.assign(coarse_vertex_count_, kNone);
  outer_of_.assign(coarse_vertex_count_, kNone);
  vertex_is_wound_.assign(coarse_vertex_count_, 0);
  rim_.clear();
  const auto is_outer = [&](std::size_t i) { return i >= is_wound.size() || is_wound[i] == 0; };
  const auto is_gap = [](const TriangleCorners& t) { return t[0] == t[1]; };
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    if (!is_outer(i) || is_gap(triangles[i])) continue;
    coarse_triangles_.push_back(triangles[i]);
    for (const std::uint32_t v : triangles[i]) outer_of_[v] = v;
  }
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    if (is_outer(i) || is_gap(triangles[i])) continue;
    TriangleCorners& corners = coarse_triangles_.emplace_back(triangles[i]);
    for (std::uint32_t& v : corners) {
      std::uint32_t& drawn_as = wound_of_[v];
      if (drawn_as == kNone && outer_of_[v] == kNone) {
        drawn_as = v;
        vertex_is_wound_[v] = 1;
      } else if (drawn_as == kNone) {
        drawn_as = static_cast<std::uint32_t>(coarse_vertex_count_ + rim_.size());
        rim_.push_back(v);
        outer_of_.push_back(v);
        vertex_is_wound_.push_back(1);
      }
      v = drawn_as;
    }
  }
}

std::uint32_t SmoothSurface::midpoint(std::uint32_t a, std::uint32_t b) {
  std::uint32_t& value = edges_.at(a, b);
  if (value != kNone) return value;
  value = static_cast<std::uint32_t>(vertex_count());
  const std::uint32_t made = value;
  const bool is_on_wound = vertex_is_wound_[a] != 0;
  std::uint32_t outside = kNone;
  // An edge of the wound between two rim vertices is on the rim if the outside, which went before,
  // has it too.
  if (!is_on_wound)
    outside = made;
  else if (outer_of_[a] != kNone && outer_of_[b] != kNone)
    outside = edges_.at(outer_of_[a], outer_of_[b]);
  midpoints_.push_back({a, b, is_on_wound ? outside : kNone});
  outer_of_.push_back(outside);
  vertex_is_wound_.push_back(is_on_wound);
  return made;
}

void SmoothSurface::halve_edges() {
  edges_.clear(3 * fine_triangles_.size());
  finer_.clear();
  finer_.reserve(fine_triangles_.size() * 4);
  for (const auto& [a, b, c] : fine_triangles_) {
    const std::uint32_t ab = midpoint(a, b), bc = midpoint(b, c), ca = midpoint(c, a);
    finer_.insert(finer_.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
  }
  std::swap(fine_triangles_, finer_);
}

void SmoothSurface::build(std::size_t vertex_count, std::span<const TriangleCorners> triangles,
                          std::span<const std::uint8_t> is_wound, std::size_t triangle_budget) {
  coarse_vertex_count_ = vertex_count;
  midpoints_.clear();
  split_rim(triangles, is_wound);
  fine_triangles_ = coarse_triangles_;
  for (int level = 0; level < 2 && fine_triangles_.size() * 4 <= triangle_budget; ++level)
    halve_edges();
  is_rim_.assign(this->vertex_count(), 0);
  for (const std::uint32_t v : rim_) is_rim_[v] = 1;
  for (const Midpoint& m : midpoints_)
    if (m.same_as != kNone) is_rim_[m.same_as] = 1;
}

void SmoothSurface::update(std::span<const Vec3f> coarse_positions) {
  positions_.assign(coarse_positions.begin(), coarse_positions.end());
  positions_.reserve(vertex_count());
  for (const std::uint32_t vertex : rim_) positions_.push_back(positions_[vertex]);
  compute_normals(positions_, coarse_triangles_, normals_);
  normals_.reserve(vertex_count());
  for (const Midpoint& m : midpoints_) {
    const Vec3f na = normals_[m.a], nb = normals_[m.b];
    if (m.same_as != kNone) {
      positions_.push_back(positions_[m.same_as]);
    } else {
      const Vec3f edge = positions_[m.b] - positions_[m.a];
      const float bend_a = dot(edge, na), bend_b = -dot(edge, nb);
      positions_.push_back((positions_[m.a] + positions_[m.b]) * 0.5f -
                           (na * bend_a + nb * bend_b) * 0.125f);
    }
    normals_.push_back(normalized(na + nb, na));
  }
}

}  // namespace trocar::shape
