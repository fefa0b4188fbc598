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

// The positive side of a segment's strip. It stays on the same hand of the blade's motion, however
// sharp the blade turns; but one that goes back as it came stays in its own cut, and there the side
// is on the other hand.
struct Side {
  Vec3d normal;  // unit, to that side; zero: there was no strip yet
  bool is_on_other_hand = false;
};
using Sides = std::array<Side, kMaxEdgePoints - 1>;  // of the last strip, by segment

// extension: m. Triangles without area are left out. Their normals are to the positive side, and
// `sides` becomes that of this strip. least_turn: m; where a shorter motion leads is chance, and
// its side is that nearest to the last one.
void make_patch(const Strip& strip, double extension, double least_turn, Sides& sides,
                std::vector<PatchTriangle>& out);

// This is what a strip is near a place.
struct NearestPart {
  double distance_squared = 0;  // m^2
  double height = 0;            // m, to the positive side
  bool is_joint = false;        // it is where this strip goes on from the last one
};
// The part of a strip, without any extension, that is nearest to p. `before` and `after`: the sides
// of the last strip and of this one; at the joint of two that make a corner, the positive side is
// that of the mean of their normals (Baerentzen and Aanaes 2005, pseudonormals of an edge).
// `triangles`: the strip by make_patch() without extension. Nothing if there are none.
std::optional<NearestPart> nearest_part(const Strip& strip,
                                        std::span<const PatchTriangle> triangles,
                                        const Sides& before, const Sides& after, const Vec3d& p);

}  // namespace trocar::cutting
