#pragma once

// The surface that a blade sweeps: its edge, a line of two to eight points, from one place to
// another is a ruled strip, two triangles per segment. The strip is longer than the motion: it runs
// ahead of the edge, past both of its ends, and at the start of a stroke backwards, so that the
// cut rounds to the nearest element and not down.

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/math/vec3.h"

namespace trocar::cutting {

inline constexpr std::size_t kMaxEdgePoints = 8;
// m; a longer edge is no blade.
inline constexpr double kMaxEdgeLength = 1;
inline constexpr double kMaxFromOrigin = 10;  // m

struct BladeEdge {
  std::array<Vec3d, kMaxEdgePoints> points;
  std::uint32_t count = 0;

  std::span<const Vec3d> span() const { return {points.data(), count}; }
};
// Two to eight finite points within 10 m, no two in a row at one place, not too long.
bool is_blade(std::span<const Vec3d> points);
double longest_motion(const BladeEdge& from, const BladeEdge& to);
BladeEdge between(const BladeEdge& from, const BladeEdge& to, double t);

struct PatchTriangle {
  std::array<Vec3d, 3> corners;
  Vec3d normal;                 // unit, counter-clockwise
  std::array<Vec3d, 3> inward;  // unit, in the plane, across the edge from each corner to the next
};

// Nothing if it has no area.
std::optional<PatchTriangle> make_triangle(const std::array<Vec3d, 3>& corners);
double signed_distance(const PatchTriangle& triangle, const Vec3d& p);  // to its plane
double distance_squared(const PatchTriangle& triangle, const Vec3d& p);
// Returns whether the point's projection onto the triangle's plane is inside the triangle, or
// outside by at most `slack` (m).
bool is_inside(const PatchTriangle& triangle, const Vec3d& p, double slack);

struct Strip {
  BladeEdge from, to;
  bool is_first = false;
};

// Each segment of an edge has a normal to its positive side; it goes on from strip to strip.
using SideNormals = std::array<Vec3d, kMaxEdgePoints - 1>;

// extension: m. Triangles without area are left out.
void make_patch(const Strip& strip, double extension, SideNormals& sides,
                std::vector<PatchTriangle>& out);

}  // namespace trocar::cutting
