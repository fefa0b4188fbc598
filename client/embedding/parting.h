#pragma once

// Parts a fine triangle along the coarse faces that lie under it.
//
//   fine triangle, by the places of its corners on the coarse surface
//          |  looked at along `chart`, a direction out of the surface
//          v
//   plane in which the faces' triangles lie side by side  ->  convex parts, one face each
//
// Parts cover the triangle: what lies on no face, because the faces under it do not join in that
// plane, goes to the nearest one. A rim is an edge of a face beyond which the outside does not go
// on: there a cut has parted it.
//
// All in double precision around the triangle. Keeps its memory. Thread: render thread.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/math/vec3.h"

namespace trocar::embedding {

// A rim that comes so near to a triangle parts it: above the grid of places at rest, 32 um, so that
// rounding never leaves a corner on the wrong side.
inline constexpr double kRimSlackMetres = 80e-6;

struct FaceUnder {
  std::array<Vec3f, 3> corners;  // at rest, m
  std::array<bool, 3> is_rim{};  // of the edge from corner k to the next
};

// Tells which of a triangle's corners, and of its edges from corner k to the next, a rim is near.
struct RimTouch {
  bool is_any = false;
  std::array<bool, 3> corners{}, edges{};
};

struct PartPoint {
  std::array<float, 3> share{};   // of the fine triangle's corners
  std::array<float, 3> weight{};  // of the face's corners, at least 0
};
struct Part {
  std::uint32_t face = 0;              // in the list of faces under it
  std::uint32_t first = 0, count = 0;  // of points(), around the part as around the triangle
};

class Parting {
 public:
  // `base`: places of the corners on the coarse surface at rest, m. False: seen along `chart` the
  // triangle has hardly an area, and cannot be parted.
  bool look_at(const std::array<Vec3f, 3>& base, const Vec3f& chart,
               std::span<const FaceUnder> faces);
  const RimTouch& rims() const { return rims_; }
  // Parts the triangle that was looked at.
  void part();
  const std::vector<Part>& parts() const { return parts_; }
  const std::vector<PartPoint>& points() const { return points_; }

 private:
  struct Point {
    double x = 0, y = 0;
  };
  static constexpr std::size_t kMostCorners = 24;
  struct Polygon {
    std::array<Point, kMostCorners> corner;
    std::size_t count = 0;
    void add(const Point& p) {
      if (count < kMostCorners) corner[count++] = p;
    }
  };
  using Corners = std::array<Point, 3>;

  static double area(const Polygon& polygon);
  static double turn(const Point& a, const Point& b, const Point& c);
  // Cuts along the line a b: what lies to its left, and the rest.
  static void split(const Polygon& whole, const Point& a, const Point& b, Polygon& left,
                    Polygon& right);
  static double distance(const Point& a, const Point& b, const Point& c, const Point& d);
  Point seen(const Vec3f& p) const;
  void touch_rims();
  void give(const Polygon& polygon, std::uint32_t face);
  std::uint32_t nearest_face(const Polygon& polygon) const;

  Vec3f origin_, along_, across_;
  Corners triangle_;  // counter-clockwise, or its mirror image
  double sense_ = 1;  // -1: mirrored
  std::vector<Corners> faces_;
  std::vector<std::array<bool, 3>> face_rims_;
  RimTouch rims_;
  std::vector<Polygon> rest_, next_;
  std::vector<Part> parts_;
  std::vector<PartPoint> points_;
};

}  // namespace trocar::embedding
