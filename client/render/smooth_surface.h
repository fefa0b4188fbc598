#pragma once

// A coarse triangle surface made smooth for the eye: area-weighted vertex normals from the moving
// triangles, then each edge halved once or twice with a midpoint that bulges as the normals say
// (curved PN triangles, Vlachos et al. 2001, evaluated at edge midpoints). The vertices that the
// server sent stay exactly where they are; only what lies between them is drawn rounder.
// Thread: render thread.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/math/vec3.h"

namespace trocar::render {

using TriangleCorners = std::array<std::uint32_t, 3>;

// Area-weighted, unit length; zero triangles contribute nothing.
void compute_normals(std::span<const Vec3f> positions, std::span<const TriangleCorners> triangles,
                     std::vector<Vec3f>& normals);

class SmoothSurface {
 public:
  // Halves edges while the result has at most `triangle_budget` triangles, at most twice.
  SmoothSurface() = default;
  SmoothSurface(std::size_t vertex_count, std::span<const TriangleCorners> triangles,
                std::size_t triangle_budget);

  const std::vector<TriangleCorners>& triangles() const { return fine_triangles_; }
  std::size_t coarse_vertex_count() const { return coarse_vertex_count_; }
  std::size_t vertex_count() const { return coarse_vertex_count_ + midpoints_.size(); }

  // Fills positions() and normals() from the coarse positions.
  void update(std::span<const Vec3f> coarse_positions);
  const std::vector<Vec3f>& positions() const { return positions_; }
  const std::vector<Vec3f>& normals() const { return normals_; }

  // Extends per-vertex values to the midpoints by averaging; `values` has vertex_count() entries of
  // which the coarse ones are set.
  template <typename T>
  void average_midpoints(std::vector<T>& values) const {
    for (std::size_t i = 0; i < midpoints_.size(); ++i)
      values[coarse_vertex_count_ + i] =
          (values[midpoints_[i][0]] + values[midpoints_[i][1]]) * 0.5f;
  }

 private:
  std::size_t coarse_vertex_count_ = 0;
  std::vector<TriangleCorners> coarse_triangles_, fine_triangles_;
  std::vector<std::array<std::uint32_t, 2>> midpoints_;  // parents; level by level
  std::vector<Vec3f> positions_, normals_;
};

}  // namespace trocar::render
