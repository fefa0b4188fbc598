#pragma once

// A tree of boxes over triangles: which pairs of triangles may touch, and which point of the
// surface is nearest.
//
// Boxes are halved at the median centre along their longest side; a leaf holds four triangles at
// most. Building takes O(n log n). The positions and triangles must outlive the tree. A const tree
// may be read by any thread.

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "common/math/box.h"
#include "common/math/vec3.h"
#include "server/organs/mesh/tet_mesh.h"

namespace trocar::surface {

// The point of a triangle that is nearest, and on what of it: its inside, an edge (from corner i to
// the next) or a corner.
struct NearestPoint {
  enum class Part : std::uint8_t { Inside, Edge, Corner };

  Vec3d point;
  double distance_squared = 0;
  std::size_t triangle = 0;
  Part part = Part::Inside;
  int corner = 0;  // of the edge or the corner
};

class TriangleTree {
 public:
  TriangleTree(std::span<const Vec3d> positions, std::span<const mesh::Triangle> triangles);

  // There must be a triangle.
  NearestPoint nearest(const Vec3d& p) const;
  // Pairs of triangles whose boxes touch, each once, the lower first.
  void for_each_close_pair(const std::function<void(std::size_t, std::size_t)>& visit) const;

 private:
  using Box = trocar::Box<double>;
  struct Node {
    Box box;
    std::uint32_t first = 0, count = 0;  // triangles of a leaf in order_
    std::uint32_t left = 0, right = 0;   // of an inner node
  };

  std::uint32_t build(std::uint32_t first, std::uint32_t count);
  void search(std::uint32_t node, const Vec3d& p, NearestPoint& best) const;
  void close_pairs(std::uint32_t a, std::uint32_t b,
                   const std::function<void(std::size_t, std::size_t)>& visit) const;
  Box box_of(std::size_t triangle) const;
  static double distance_squared(const Box& box, const Vec3d& p);

  std::span<const Vec3d> positions_;
  std::span<const mesh::Triangle> triangles_;
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace trocar::surface
