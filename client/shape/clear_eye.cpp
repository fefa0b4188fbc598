#include "client/shape/clear_eye.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace trocar::shape {
namespace {

constexpr float kLeastStep = 0.0004f;  // m

struct Triangle {
  Vec3f a, b, c;
};

// Returns how far its nearest point is (Ericson 2005, 5.1.5).
float distance_to(const Triangle& t, const Vec3f& p) {
  const Vec3f ab = t.b - t.a, ac = t.c - t.a, ap = p - t.a;
  const float d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return length(ap);
  const Vec3f bp = p - t.b;
  const float d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return length(bp);
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return length(ap - ab * (d1 / (d1 - d3)));
  const Vec3f cp = p - t.c;
  const float d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return length(cp);
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return length(ap - ac * (d2 / (d2 - d6)));
  const float va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
    return length(bp - (t.c - t.b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6))));
  const float sum = 1 / (va + vb + vc);
  return length(ap - ab * (vb * sum) - ac * (vc * sum));
}

// A place where the way back leaves the tissue, or enters it (-1).
struct Crossing {
  float along = 0;
  int leaves = 0;
};

// The axis, seen along itself: what lies around it has two coordinates across.
class Axis {
 public:
  Axis(const Vec3f& eye, const Vec3f& back)
      : eye_(eye),
        back_(back),
        right_(normalized(cross(back, std::abs(back.y) < 0.9f ? Vec3f{0, 1, 0} : Vec3f{1, 0, 0}),
                          Vec3f{1, 0, 0})),
        up_(cross(back, right_)) {}

  // Appends where the way back crosses the triangle. An edge that it meets is counted for one of
  // the two triangles beside it, whichever way round these are listed.
  void cross_triangle(const Triangle& t, std::vector<Crossing>& crossings) const {
    const Across a = across(t.a), b = across(t.b), c = across(t.c);
    const double wa = side(b, c), wb = side(c, a), wc = side(a, b);
    const bool is_left = wa > 0 && wb > 0 && wc > 0, is_entered = wa < 0 && wb < 0 && wc < 0;
    if (!is_left && !is_entered) return;
    const auto along =
        static_cast<float>((wa * depth(t.a) + wb * depth(t.b) + wc * depth(t.c)) / (wa + wb + wc));
    if (along > 0) crossings.push_back({along, is_left ? 1 : -1});
  }

 private:
  struct Across {
    double x = 0, y = 0;
  };
  Across across(const Vec3f& p) const {
    const Vec3f w = p - eye_;
    return {dot(w, right_), dot(w, up_)};
  }
  double depth(const Vec3f& p) const { return dot(p - eye_, back_); }
  static double side(const Across& p, const Across& q) {
    const double twice = p.x * q.y - p.y * q.x;
    if (twice != 0) return twice;
    return p.y > q.y || (p.y == q.y && p.x > q.x) ? 1e-30 : -1e-30;
  }

  Vec3f eye_, back_, right_, up_;
};

// A part of the surface is near the way back, or near where it begins.
struct Surroundings {
  std::vector<Triangle> on_the_way, around;
  std::vector<Crossing> crossings;  // nearest first
};

Surroundings look_around(const Vec3f& eye, const Vec3f& back, std::span<const Vec3f> positions,
                         std::span<const TriangleCorners> triangles, float clear_m) {
  Surroundings found;
  const Axis axis(eye, back);
  for (const auto& corners : triangles) {
    if (corners[0] == corners[1]) continue;
    const Triangle t{positions[corners[0]], positions[corners[1]], positions[corners[2]]};
    const Vec3f middle = (t.a + t.b + t.c) * (1.0f / 3);
    const float radius =
        std::sqrt(std::max({length_squared(t.a - middle), length_squared(t.b - middle),
                            length_squared(t.c - middle)})) *
        1.001f;
    const Vec3f w = middle - eye;
    const float along = dot(w, back), apart = length(w);
    if (apart - radius < kLookMetres) found.around.push_back(t);
    const float reach = radius + clear_m;
    if (along < -reach || apart * apart - along * along > reach * reach) continue;
    found.on_the_way.push_back(t);
    axis.cross_triangle(t, found.crossings);
  }
  std::ranges::sort(found.crossings, {}, &Crossing::along);
  return found;
}

float nearest(const std::vector<Triangle>& triangles, const Vec3f& p, float most_m) {
  float least = most_m;
  for (const Triangle& t : triangles) least = std::min(least, distance_to(t, p));
  return least;
}

// Returns the first place from `along` on where the winding number is zero.
float leave(const std::vector<Crossing>& crossings, float along) {
  int winding = 0;
  for (const Crossing& c : crossings) winding += c.along > along ? c.leaves : 0;
  for (const Crossing& c : crossings) {
    if (winding <= 0) break;
    if (c.along <= along) continue;
    along = c.along;
    winding -= c.leaves;
  }
  return along;
}

}  // namespace

ClearEye clear_eye(const Vec3f& eye, const Vec3f& forward, std::span<const Vec3f> positions,
                   std::span<const TriangleCorners> triangles, float clear_m) {
  const Vec3f back = -forward;
  const Surroundings around = look_around(eye, back, positions, triangles, clear_m);
  float along = 0;
  for (;;) {
    along = leave(around.crossings, along);
    const float clear = nearest(around.on_the_way, eye + back * along, clear_m);
    if (clear >= clear_m) break;
    along += std::max(clear_m - clear, kLeastStep);
  }
  if (along == 0) return {0, nearest(around.around, eye, kLookMetres)};
  // It has come out of the tissue just now, which is near.
  const Vec3f place = eye + back * along;
  const auto there = look_around(place, back, positions, triangles, clear_m).around;
  return {along, nearest(there, place, kLookMetres)};
}

float near_plane(float nearest_m, float tan_half_height, float aspect) {
  const float across = tan_half_height * aspect;
  return nearest_m / std::sqrt(1 + tan_half_height * tan_half_height + across * across);
}

}  // namespace trocar::shape
