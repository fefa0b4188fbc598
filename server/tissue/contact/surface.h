#pragma once

// The boundary triangles as contact sees them: where they are now, which of them are near a box,
// and the quadrature points on each at which contact acts.
//
// A triangle whose longest edge is e is cut into n^2 equal parts, n = ceil(e / spacing), at most
// kMaxDivisions, or kFineDivisions; the centre of each part is a quadrature point that stands for
// its share of the area. So the pressure of a tool is an integral over the surface, and two meshes
// of one surface agree about it (nodes alone were seen to give two answers 15 % apart). Divisions
// follow from the rest shape, unless a triangle is stretched far.
//
// Triangles are kept in bundles along a Morton curve, each with the box around its nodes as they
// were when it was last looked into, which holds to as far as the surface has moved since. What an
// edit adds gets bundles of its own, in its order.
// collect(): O(bundles + those that may be near).

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "common/base/index.h"
#include "common/math/box.h"
#include "server/organs/organ/organ.h"
#include "server/tissue/topology/edit.h"
#include "server/tissue/world/world.h"

namespace trocar::contact {

using Box = trocar::Box<float>;

inline constexpr std::uint32_t kMaxDivisions = 8;
// A triangle that would have more than kManyDivisions gets these: a tool that is so much thinner
// than the elements would pass between its points.
inline constexpr std::uint32_t kFineDivisions = 16, kManyDivisions = 12;

struct SurfaceTriangle {
  std::array<NodeIndex, 3> nodes;  // counter-clockwise seen from outside
  float area = 0;                  // m^2, at rest
  float longest_edge = 0;          // m, at rest

  // width_m: as it is now. A triangle that is stretched has more points, but not before a quarter
  // more, so that their number does not flutter.
  std::uint32_t divisions(float spacing_m, float width_m) const {
    const float edge = std::max(longest_edge, 0.8f * width_m);
    const auto wanted = static_cast<std::uint32_t>(std::ceil(edge / spacing_m));
    return wanted > kManyDivisions ? kFineDivisions : std::clamp(wanted, 1u, kMaxDivisions);
  }
};

// Barycentric centres of the n^2 parts of a triangle, n as divisions() says; sum of each is 1.
std::span<const std::array<float, 3>> quadrature_points(std::uint32_t divisions);

class Surface {
 public:
  explicit Surface(const organ::Organ& organ);

  // Returns a triangle by its number; those of the uncut organ are numbered as in its mesh.
  const SurfaceTriangle& operator[](TriangleIndex triangle) const {
    return triangles_[triangle.value];
  }
  std::size_t triangle_count() const { return triangles_.size(); }

  // O(the edit).
  void update(const topology::SurfaceEdit& edit, const world::World& world);

  // Triangles whose box, now, overlaps the given one; ascending. travel_m: a sum over ticks of the
  // farthest that any node has moved.
  void collect(const Box& box, const world::World& world, double travel_m,
               std::vector<TriangleIndex>& found);

 private:
  struct Bundle {
    std::uint32_t first_triangle = 0, last_triangle = 0;  // into order_
    std::uint32_t first_node = 0, last_node = 0;          // into nodes_
    std::uint32_t triangles = 0;                          // that are left
    Box box;
    bool has_box = false;
    double travel_m = 0;  // when the box was taken
  };

  void add_bundle(std::size_t first, std::size_t last);

  std::vector<SurfaceTriangle> triangles_;  // invalid nodes where one is gone
  std::vector<std::uint32_t> bundle_of_;    // per triangle
  std::vector<TriangleIndex> order_;
  std::vector<NodeIndex> nodes_;
  std::vector<Bundle> bundles_;
};

}  // namespace trocar::contact
