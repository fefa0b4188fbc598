#include "server/organs/surface/triangle_tree.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "common/base/assert.h"

namespace trocar::surface {
namespace {

constexpr std::uint32_t kLeafTriangles = 4;

using Part = NearestPoint::Part;

// The cases are those of Ericson: Real-Time Collision Detection, 2005, section 5.1.5.
NearestPoint nearest_in(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const Vec3d ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = dot(ab, ap), d2 = dot(ac, ap);
  const auto result = [&](const Vec3d& q, Part part, int corner) {
    return NearestPoint{q, length_squared(p - q), 0, part, corner};
  };
  if (d1 <= 0 && d2 <= 0) return result(a, Part::Corner, 0);
  const double d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return result(b, Part::Corner, 1);
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0 && d1 > d3)
    return result(a + ab * (d1 / (d1 - d3)), Part::Edge, 0);
  const double d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return result(c, Part::Corner, 2);
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0 && d2 > d6)
    return result(a + ac * (d2 / (d2 - d6)), Part::Edge, 2);
  const double va = d3 * d6 - d5 * d4, along = d4 - d3, back = d5 - d6;
  if (va <= 0 && along >= 0 && back >= 0 && along + back > 0)
    return result(b + (c - b) * (along / (along + back)), Part::Edge, 1);
  const double sum = va + vb + vc;
  if (!(sum > 0)) return result(a, Part::Corner, 0);  // a triangle without area
  return result(a + ab * (vb / sum) + ac * (vc / sum), Part::Inside, 0);
}

double& at(Vec3d& v, int axis) {
  return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

}  // namespace

TriangleTree::TriangleTree(std::span<const Vec3d> positions,
                           std::span<const mesh::Triangle> triangles)
    : positions_(positions), triangles_(triangles), order_(triangles.size()) {
  std::iota(order_.begin(), order_.end(), std::uint32_t{0});
  nodes_.reserve(triangles.size());
  if (!triangles.empty()) build(0, static_cast<std::uint32_t>(triangles.size()));
}

TriangleTree::Box TriangleTree::box_of(std::size_t triangle) const {
  Box box;
  for (const NodeIndex corner : triangles_[triangle]) box.include(positions_[corner.value]);
  return box;
}

std::uint32_t TriangleTree::build(std::uint32_t first, std::uint32_t count) {
  const auto number = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  Box box;
  for (std::uint32_t i = first; i < first + count; ++i)
    for (const NodeIndex corner : triangles_[order_[i]]) box.include(positions_[corner.value]);
  nodes_[number].box = box;
  if (count <= kLeafTriangles) {
    nodes_[number].first = first, nodes_[number].count = count;
    return number;
  }
  const Vec3d size = box.most - box.least;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const auto key = [&](std::uint32_t triangle) {
    Box b = box_of(triangle);
    return at(b.least, axis) + at(b.most, axis);
  };
  const auto begin = order_.begin() + first;
  std::nth_element(begin, begin + count / 2, begin + count, [&](std::uint32_t a, std::uint32_t b) {
    const double ka = key(a), kb = key(b);
    return ka != kb ? ka < kb : a < b;
  });
  const auto left = build(first, count / 2);
  const auto right = build(first + count / 2, count - count / 2);
  nodes_[number].left = left, nodes_[number].right = right;
  return number;
}

double TriangleTree::distance_squared(const Box& box, const Vec3d& p) {
  const auto beyond = [](double low, double high, double value) {
    return std::max({low - value, value - high, 0.0});
  };
  const double x = beyond(box.least.x, box.most.x, p.x), y = beyond(box.least.y, box.most.y, p.y),
               z = beyond(box.least.z, box.most.z, p.z);
  return x * x + y * y + z * z;
}

NearestPoint TriangleTree::nearest(const Vec3d& p) const {
  TROCAR_ASSERT(!nodes_.empty());
  NearestPoint best;
  best.distance_squared = std::numeric_limits<double>::max();
  search(0, p, best);
  return best;
}

void TriangleTree::search(std::uint32_t number, const Vec3d& p, NearestPoint& best) const {
  const Node& node = nodes_[number];
  if (node.count > 0) {
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const auto& [a, b, c] = triangles_[order_[i]];
      auto found = nearest_in(p, positions_[a.value], positions_[b.value], positions_[c.value]);
      if (found.distance_squared >= best.distance_squared) continue;
      found.triangle = order_[i];
      best = found;
    }
    return;
  }
  const double left = distance_squared(nodes_[node.left].box, p),
               right = distance_squared(nodes_[node.right].box, p);
  const bool is_left_first = left <= right;
  if (std::min(left, right) < best.distance_squared)
    search(is_left_first ? node.left : node.right, p, best);
  if (std::max(left, right) < best.distance_squared)
    search(is_left_first ? node.right : node.left, p, best);
}

void TriangleTree::for_each_close_pair(
    const std::function<void(std::size_t, std::size_t)>& visit) const {
  if (!nodes_.empty()) close_pairs(0, 0, visit);
}

void TriangleTree::close_pairs(std::uint32_t a, std::uint32_t b,
                               const std::function<void(std::size_t, std::size_t)>& visit) const {
  const Node& first = nodes_[a];
  const Node& second = nodes_[b];
  if (a != b && !first.box.overlaps(second.box)) return;
  if (first.count > 0 && second.count > 0) {
    for (std::uint32_t i = first.first; i < first.first + first.count; ++i)
      for (std::uint32_t j = a == b ? i + 1 : second.first; j < second.first + second.count; ++j)
        if (box_of(order_[i]).overlaps(box_of(order_[j])))
          visit(std::min(order_[i], order_[j]), std::max(order_[i], order_[j]));
    return;
  }
  if (a == b) {
    close_pairs(first.left, first.left, visit);
    close_pairs(first.right, first.right, visit);
    close_pairs(first.left, first.right, visit);
  } else if (first.count > 0) {
    close_pairs(a, second.left, visit);
    close_pairs(a, second.right, visit);
  } else {
    close_pairs(first.left, b, visit);
    close_pairs(first.right, b, visit);
  }
}

}  // namespace trocar::surface
