#pragma once

// Triangles in a grid of cubes, by where they are at rest: which are near a place, which is
// nearest.
//
// build() keeps its memory: cost linear in the triangles. Thread: render thread.

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "common/math/box.h"
#include "common/math/vec3.h"

namespace trocar::embedding {

using TriangleCorners = std::array<std::uint32_t, 3>;
inline constexpr std::uint32_t kNoFace = 0xffffffffu;

// The place of a triangle that is nearest to a point.
struct FacePlace {
  std::uint32_t face = kNoFace;
  std::array<float, 3> weight{};  // of the corners, at least 0, sum 1
  float distance_m = 0;
};
FacePlace nearest_on(const Vec3f& p, const Vec3f& a, const Vec3f& b, const Vec3f& c);

class FaceGrid {
 public:
  // Cells are about as large as `cell_m`, at most 48 along a side, and larger where triangles would
  // meet more than some 32 each. Triangles without area (equal corners) are left out; their numbers
  // stay. The positions and triangles must outlive the grid's use.
  void build(std::span<const Vec3f> positions, std::span<const TriangleCorners> triangles,
             float cell_m);

  // Appends the triangles whose own boxes meet the box, each once, in no order. Ends early once it
  // has looked at `most` cells and triangles.
  void find(const Box<float>& box, std::vector<std::uint32_t>& found,
            std::size_t most = std::numeric_limits<std::size_t>::max()) const;
  // The nearest triangle that faces along `normal`, within 90 degrees; of any side if none does.
  // kNoFace: there is none within about two cells. It looks at no more than some thousands, however
  // many a server that means harm has put into a cell: then it is the nearest of those.
  FacePlace nearest(const Vec3f& p, const Vec3f& normal) const;

  float cell_m() const { return cell_m_; }
  std::size_t entry_count() const { return entries_.size(); }  // triangles, in each of their cells

 private:
  std::array<int, 3> cell_of(const Vec3f& p) const;
  Box<float> box_of(std::size_t triangle) const;
  // Makes the cells so large that the triangles meet few of them; returns how many cells there are.
  std::size_t choose_cells(float cell_m);
  // Ends once `visit` returns false.
  template <typename Visit>
  void for_cells(const Box<float>& box, const Visit& visit) const;

  std::span<const Vec3f> positions_;
  std::span<const TriangleCorners> triangles_;
  Vec3f origin_;
  float cell_m_ = 1;
  std::array<int, 3> size_{1, 1, 1};
  Box<float> all_;
  std::vector<std::uint32_t> first_, entries_;  // of each cell, one more at the end
  mutable std::vector<std::uint32_t> seen_;     // per triangle: the last query that met it
  mutable std::uint32_t query_ = 0;
};

}  // namespace trocar::embedding
