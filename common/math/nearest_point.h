#pragma once

#include <algorithm>

#include "common/math/vec3.h"

namespace trocar {

// Barycentric weights of the point of a triangle closest to p: none is negative, and
// their sum is 1 but for rounding (Ericson, Real-Time Collision
// Detection, 5.1.5).
inline Vec3f nearest_weights(const Vec3f& p, const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  const Vec3f ab = b - a, ac = c - a, ap = p - a;
  const float d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  const Vec3f bp = p - b;
  const float d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0 && d1 > d3) {
    const float v = d1 / (d1 - d3);
    return {1 - v, v, 0};
  }
  const Vec3f cp = p - c;
  const float d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0 && d2 > d6) {
    const float w = d2 / (d2 - d6);
    return {1 - w, 0, w};
  }
  const float va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0 && (d4 - d3) + (d5 - d6) > 0) {
    const float w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0, 1 - w, w};
  }
  const float sum = va + vb + vc;
  if (!(sum > 0)) return {1, 0, 0};  // no area
  const float v = vb / sum, w = vc / sum, u = 1 - v - w;
  if (u >= 0 && v >= 0 && w >= 0) return {u, v, w};
  // Rounding puts a point beside an edge some 1e-8 outside: it is moved back onto the triangle.
  const Vec3f inside{std::max(u, 0.0f), std::max(v, 0.0f), std::max(w, 0.0f)};
  return inside / (inside.x + inside.y + inside.z);
}

}  // namespace trocar
