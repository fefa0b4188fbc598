#include "server/organs/surface/intersection.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace trocar::surface {
namespace {

using Wide = __float128;

int sign(Wide value) {
  return (value > 0) - (value < 0);
}

// Sign of the volume of a tetrahedron: positive if d is on the side of abc from which it is seen
// clockwise.
int orientation(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
  const Vec3d p = a - d, q = b - d, r = c - d;
  const double volume = dot(cross(p, q), r);
  const auto sum = [](const Vec3d& v) { return std::abs(v.x) + std::abs(v.y) + std::abs(v.z); };
  if (std::abs(volume) > 1e-14 * sum(p) * sum(q) * sum(r)) return volume > 0 ? 1 : -1;
  const Wide px = Wide(a.x) - d.x, py = Wide(a.y) - d.y, pz = Wide(a.z) - d.z;
  const Wide qx = Wide(b.x) - d.x, qy = Wide(b.y) - d.y, qz = Wide(b.z) - d.z;
  const Wide rx = Wide(c.x) - d.x, ry = Wide(c.y) - d.y, rz = Wide(c.z) - d.z;
  return sign((py * qz - pz * qy) * rx + (pz * qx - px * qz) * ry + (px * qy - py * qx) * rz);
}

struct Flat {
  double x = 0, y = 0;
};

int orientation(const Flat& a, const Flat& b, const Flat& c) {
  return sign((Wide(b.x) - a.x) * (Wide(c.y) - a.y) - (Wide(b.y) - a.y) * (Wide(c.x) - a.x));
}

bool is_between(const Flat& a, const Flat& b, const Flat& p) {
  return std::min(a.x, b.x) <= p.x && p.x <= std::max(a.x, b.x) && std::min(a.y, b.y) <= p.y &&
         p.y <= std::max(a.y, b.y);
}

bool segments_touch(const Flat& a, const Flat& b, const Flat& c, const Flat& d) {
  const int abc = orientation(a, b, c), abd = orientation(a, b, d), cda = orientation(c, d, a),
            cdb = orientation(c, d, b);
  if (abc * abd < 0 && cda * cdb < 0) return true;
  return (abc == 0 && is_between(a, b, c)) || (abd == 0 && is_between(a, b, d)) ||
         (cda == 0 && is_between(c, d, a)) || (cdb == 0 && is_between(c, d, b));
}

// The coordinates that are left when the one along which the plane is steepest is dropped.
Flat flatten(const Vec3d& p, int dropped) {
  return dropped == 0 ? Flat{p.y, p.z} : dropped == 1 ? Flat{p.x, p.z} : Flat{p.x, p.y};
}

int dropped_axis(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const Vec3d n = cross(b - a, c - a);
  const double x = std::abs(n.x), y = std::abs(n.y), z = std::abs(n.z);
  return x >= y && x >= z ? 0 : y >= z ? 1 : 2;
}

bool flat_segment_meets(const Flat& p, const Flat& q, const std::array<Flat, 3>& t) {
  for (int i = 0; i < 3; ++i)
    if (segments_touch(p, q, t[i], t[(i + 1) % 3])) return true;
  const int s0 = orientation(t[0], t[1], p), s1 = orientation(t[1], t[2], p),
            s2 = orientation(t[2], t[0], p);
  return s0 != 0 && s0 == s1 && s1 == s2;
}

// Whether the segment from p to q meets the triangle abc, its rim included.
bool segment_meets(const Vec3d& p, const Vec3d& q, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const int sp = orientation(a, b, c, p), sq = orientation(a, b, c, q);
  if (sp == 0 && sq == 0) {
    const int axis = dropped_axis(a, b, c);
    return flat_segment_meets(flatten(p, axis), flatten(q, axis),
                              {flatten(a, axis), flatten(b, axis), flatten(c, axis)});
  }
  if (sp * sq > 0) return false;
  const int s0 = orientation(p, q, a, b), s1 = orientation(p, q, b, c),
            s2 = orientation(p, q, c, a);
  return (s0 >= 0 && s1 >= 0 && s2 >= 0) || (s0 <= 0 && s1 <= 0 && s2 <= 0);
}

}  // namespace

bool intersect(std::span<const Vec3d> positions, const mesh::Triangle& a, const mesh::Triangle& b) {
  const auto at = [&](NodeIndex node) -> const Vec3d& { return positions[node.value]; };
  // Shared corners come first.
  mesh::Triangle p = a, q = b;
  std::size_t shared = 0;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = shared; j < 3; ++j)
      if (p[i] == q[j]) {
        std::swap(p[shared], p[i]);
        std::swap(q[shared], q[j]);
        ++shared;
        break;
      }
  if (shared == 3) return true;
  if (shared == 2) {
    // They overlap only where one is folded flat onto the other.
    if (orientation(at(p[0]), at(p[1]), at(p[2]), at(q[2])) != 0) return false;
    const int axis = dropped_axis(at(p[0]), at(p[1]), at(p[2]));
    const Flat u = flatten(at(p[0]), axis), v = flatten(at(p[1]), axis);
    return orientation(u, v, flatten(at(p[2]), axis)) * orientation(u, v, flatten(at(q[2]), axis)) >
           0;
  }
  if (shared == 1)
    return segment_meets(at(p[1]), at(p[2]), at(q[0]), at(q[1]), at(q[2])) ||
           segment_meets(at(q[1]), at(q[2]), at(p[0]), at(p[1]), at(p[2]));
  for (std::size_t i = 0; i < 3; ++i)
    if (segment_meets(at(p[i]), at(p[(i + 1) % 3]), at(q[0]), at(q[1]), at(q[2])) ||
        segment_meets(at(q[i]), at(q[(i + 1) % 3]), at(p[0]), at(p[1]), at(p[2])))
      return true;
  return false;
}

std::vector<std::pair<std::size_t, std::size_t>> intersecting_pairs(
    std::span<const Vec3d> positions, std::span<const mesh::Triangle> triangles,
    const TriangleTree& tree) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  tree.for_each_close_pair([&](std::size_t a, std::size_t b) {
    if (intersect(positions, triangles[a], triangles[b])) pairs.emplace_back(a, b);
  });
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace trocar::surface
