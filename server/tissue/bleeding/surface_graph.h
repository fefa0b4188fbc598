#pragma once

// Knows which triangles lie around a surface vertex, and how much area is its own. It follows the
// surface from change to change at the cost of the change. A list holds the higher triangle numbers
// first, however it came about, so that sums over it are equal to the bit after a rebuild.

#include <cstdint>
#include <vector>

#include "common/math/vec3.h"
#include "common/wire/surface_layout.h"

namespace trocar::bleeding {

class SurfaceGraph {
 public:
  // Begins anew; every vertex counts as changed.
  void rebuild(const wire::SurfaceLayout& layout);
  // `layout`: the one that the change was applied to.
  void apply(const wire::SurfaceChange& change, const wire::SurfaceLayout& layout);

  std::size_t vertex_count() const { return first_.size(); }
  // Those whose triangles the last call has changed, ascending, each once.
  const std::vector<std::uint32_t>& changed() const { return changed_; }
  // A third of the triangles around it, at rest, m^2: of all, and of those that a blade made.
  double area_m2(std::uint32_t vertex) const { return area_m2_[vertex]; }
  double wound_m2(std::uint32_t vertex) const { return wound_m2_[vertex]; }
  const wire::Corners& corners(std::uint32_t triangle) const { return triangles_[triangle]; }

  // Calls visit(a, b) with the other corners of each triangle around it, outward.
  template <typename Visit>
  void each_triangle(std::uint32_t vertex, const Visit& visit) const {
    for (std::uint32_t at = first_[vertex]; at != kNone; at = next_[at]) {
      const auto& corners = triangles_[at / 3];
      visit(corners[(at + 1) % 3].value, corners[(at + 2) % 3].value);
    }
  }

 private:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  void add(std::uint32_t triangle);
  void remove(std::uint32_t triangle);
  void note(std::uint32_t vertex);
  void measure_changed(const wire::SurfaceLayout& layout);

  std::vector<wire::Corners> triangles_;
  std::vector<std::uint32_t> first_;  // per vertex: a corner, 3 triangle + number; kNone: none
  std::vector<std::uint32_t> next_;   // per corner: the next one of its vertex
  std::vector<double> area_m2_, wound_m2_;
  std::vector<std::uint32_t> changed_;
  std::vector<std::uint8_t> is_changed_;
};

}  // namespace trocar::bleeding
