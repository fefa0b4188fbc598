#pragma once

// A coarse triangle surface made smooth for the eye: area-weighted vertex normals from the moving
// triangles, then each edge halved once or twice with a midpoint that bulges as the normals say
// (curved PN triangles, Vlachos et al. 2001, evaluated at edge midpoints). The vertices that the
// server sent stay exactly where they are; only what lies between them is drawn rounder. The one
// exception are sharp borders of the organ, which tets make jagged: there a vertex is drawn at most
// kMostLiftMetres along its normal from where it is, so that the border is a smooth line.
//
// Wound faces are smooth among each other and meet the outside at a rim: a vertex of both is drawn
// twice, with a normal for either side. At the rim itself light sees a round lip, for which both
// copies have one normal more, between the two. Walls of a wound are cut through tets and rough, so
// their normals are averages over more triangles.
//
// The rim is a curve: a midpoint on it lies on the cubic through its four neighbours along the rim
// (Dyn, Levin and Gregory 1987), as far as the rim goes on there without a corner. The outside
// decides where it lies and the wound takes it over, so that there is no crack.
//
//   vertices: [coarse, as given][rim vertices again, for the wound][midpoints, level by level]
//
// build() keeps its memory: cost linear in the triangles, no allocation once they have ceased to
// grow. Thread: render thread.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/math/vec3.h"

namespace trocar::shape {

using TriangleCorners = std::array<std::uint32_t, 3>;

// Area-weighted, unit length; zero triangles contribute nothing.
void compute_normals(std::span<const Vec3f> positions, std::span<const TriangleCorners> triangles,
                     std::vector<Vec3f>& normals);

// Widths of what a wound's rim changes on either side of it.
inline constexpr float kMostLiftMetres = 0.0012f;  // of a vertex on a border
inline constexpr float kSeamMetres = 0.004f, kDeepMetres = 0.022f;
// Returns what the shaders take as `rest.w` of a vertex that is so far from the nearest rim:
// outside 0, and -1 on the rim; inside 1 at the rim, 2 where the wound is deep.
inline float rim_of(float distance_m, bool is_wound) {
  if (is_wound) return 1 + distance_m / kDeepMetres;
  return distance_m < kSeamMetres ? distance_m / kSeamMetres - 1 : 0.0f;
}

class SmoothSurface {
 public:
  // Halves edges while the result has at most `triangle_budget` triangles, at most twice. Triangles
  // with equal corners are left out. `is_wound` per triangle; empty: none.
  void build(std::size_t vertex_count, std::span<const TriangleCorners> triangles,
             std::span<const std::uint8_t> is_wound, std::size_t triangle_budget);

  // Smooths the borders of what was built, as they are at rest; a wound's rim is none. Without this
  // they are drawn as they are.
  void smooth_borders(std::span<const Vec3f> rest);

  const std::vector<TriangleCorners>& triangles() const { return fine_triangles_; }
  // The first so many of the triangles are of the outside.
  std::size_t outer_triangle_count() const {
    return coarse_triangles_.empty()
               ? 0
               : first_wound_triangle_ * (fine_triangles_.size() / coarse_triangles_.size());
  }
  std::size_t coarse_vertex_count() const { return coarse_vertex_count_; }
  // These are halved: outer ones first; the wound's have their own copies of rim vertices. Each
  // became the same number of triangles(), in this order.
  std::span<const TriangleCorners> coarse_triangles() const { return coarse_triangles_; }
  std::size_t coarse_outer_count() const { return first_wound_triangle_; }
  // Coarse vertices of which the wound has copies, in the order of these.
  std::span<const std::uint32_t> rim() const { return rim_; }
  std::size_t vertex_count() const {
    return coarse_vertex_count_ + rim_.size() + midpoints_.size();
  }
  // Per vertex: 1 if it is drawn on wound faces.
  const std::vector<std::uint8_t>& is_wound() const { return vertex_is_wound_; }
  // Per vertex: 1 if it is drawn on the outside and lies on a wound's rim.
  const std::vector<std::uint8_t>& is_rim() const { return is_rim_; }

  // Fills positions() and normals() from the coarse positions.
  void update(std::span<const Vec3f> coarse_positions);
  // Per vertex: how far the nearest rim is in the positions of the last update, m, at most
  // `most_m`; measured along the side of the rim that the vertex is on.
  void measure_rim(float most_m, std::vector<float>& distances) const;
  const std::vector<Vec3f>& positions() const { return positions_; }
  const std::vector<Vec3f>& normals() const { return normals_; }
  // Those of lips where a vertex is on a rim, elsewhere normals().
  const std::vector<Vec3f>& lips() const { return lips_; }

  // Extends per-vertex values to rim and midpoints, these by averaging; `values` has vertex_count()
  // entries of which the coarse ones are set.
  template <typename T>
  void extend_values(std::vector<T>& values) const {
    std::size_t next = coarse_vertex_count_;
    for (const std::uint32_t vertex : rim_) values[next++] = values[vertex];
    extend_midpoints(values);
  }
  // Extends them to midpoints alone: rim vertices have values of their own.
  template <typename T>
  void extend_midpoints(std::vector<T>& values) const {
    std::size_t next = coarse_vertex_count_ + rim_.size();
    for (const Midpoint& m : midpoints_) values[next++] = (values[m.a] + values[m.b]) * 0.5f;
  }

 private:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  struct Midpoint {
    std::uint32_t a = 0, b = 0;     // parents
    std::uint32_t same_as = kNone;  // on the rim: the outside's midpoint
  };
  // The rim goes on to `before` beyond a, to `after` beyond b; kNone: it ends, or there is a fork.
  struct RimMidpoint {
    std::uint32_t vertex = 0, a = 0, b = 0, before = kNone, after = kNone;
  };
  // Edges to midpoints, open addressing.
  class EdgeTable {
   public:
    void clear(std::size_t most_edges);
    // The value of an edge, in either direction; kNone where it is new, to be set.
    std::uint32_t& at(std::uint32_t a, std::uint32_t b);

   private:
    struct Slot {
      std::uint64_t key = kEmpty;
      std::uint32_t value = kNone;
    };
    static constexpr std::uint64_t kEmpty = ~std::uint64_t{0};
    std::vector<Slot> slots_;
    unsigned shift_ = 0;
  };

  void split_rim(std::span<const TriangleCorners> triangles,
                 std::span<const std::uint8_t> is_wound);
  void halve_edges();
  void follow_rim(std::size_t first_midpoint);
  void compute_coarse_normals();
  void average_walls();
  std::span<const TriangleCorners> walls() const {
    return std::span(coarse_triangles_).subspan(first_wound_triangle_);
  }
  Vec3f rim_position(const RimMidpoint& m) const;
  std::uint32_t midpoint(std::uint32_t a, std::uint32_t b);

  std::size_t coarse_vertex_count_ = 0;
  std::vector<TriangleCorners> coarse_triangles_, fine_triangles_, finer_;  // outer ones first
  std::vector<std::uint32_t> rim_;       // coarse vertices that are drawn again
  std::vector<std::uint32_t> wound_of_;  // per coarse vertex: as which it is drawn on wound faces
  std::vector<std::uint32_t> outer_of_;  // per vertex: its place on the outside, kNone: not there
  std::vector<Midpoint> midpoints_;      // level by level
  std::vector<RimMidpoint> rim_midpoints_;  // of the outside, in the order of midpoints_
  std::vector<std::array<std::uint32_t, 2>> along_rim_;  // per vertex of the outside, while built
  std::size_t first_wound_triangle_ = 0;                 // of the coarse ones
  std::vector<std::uint8_t> vertex_is_wound_, is_rim_;
  EdgeTable edges_;
  std::vector<Vec3f> positions_, normals_, lips_;
  std::vector<float> lifts_;   // m along the normal, per coarse vertex; empty: none
  std::vector<Vec3f> bends_;   // normals that midpoints bulge by
  std::vector<Vec3f> spread_;  // averages of the wound's normals
};

}  // namespace trocar::shape
