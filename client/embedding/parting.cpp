#include "client/embedding/parting.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace trocar::embedding {
namespace {

constexpr double kFlatShare = 1e-4;   // of a square with the longest edge: no area
constexpr double kCrumbShare = 1e-6;  // of the triangle: a part of rounding alone
constexpr std::size_t kMostPolygons = 64;

}  // namespace

double Parting::turn(const Point& a, const Point& b, const Point& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

double Parting::area(const Polygon& polygon) {
  double sum = 0;
  for (std::size_t i = 2; i < polygon.count; ++i)
    sum += turn(polygon.corner[0], polygon.corner[i - 1], polygon.corner[i]);
  return 0.5 * sum;
}

void Parting::split(const Polygon& whole, const Point& a, const Point& b, Polygon& left,
                    Polygon& right) {
  left.count = right.count = 0;
  for (std::size_t i = 0; i < whole.count; ++i) {
    const Point& p = whole.corner[i];
    const Point& q = whole.corner[(i + 1) % whole.count];
    const double side_p = turn(a, b, p), side_q = turn(a, b, q);
    (side_p >= 0 ? left : right).add(p);
    if ((side_p >= 0) == (side_q >= 0)) continue;
    const double t = side_p / (side_p - side_q);
    const Point m{p.x + (q.x - p.x) * t, p.y + (q.y - p.y) * t};
    left.add(m);
    right.add(m);
  }
}

// Returns that of two line segments, a b and c d.
double Parting::distance(const Point& a, const Point& b, const Point& c, const Point& d) {
  const auto to_segment = [](const Point& p, const Point& from, const Point& to) {
    const double x = to.x - from.x, y = to.y - from.y;
    const double square = std::max(x * x + y * y, 1e-30);
    const double t = std::clamp(((p.x - from.x) * x + (p.y - from.y) * y) / square, 0.0, 1.0);
    return std::hypot(from.x + x * t - p.x, from.y + y * t - p.y);
  };
  const bool is_crossed = turn(a, b, c) * turn(a, b, d) < 0 && turn(c, d, a) * turn(c, d, b) < 0;
  if (is_crossed) return 0;
  return std::min(
      {to_segment(a, c, d), to_segment(b, c, d), to_segment(c, a, b), to_segment(d, a, b)});
}

Parting::Point Parting::seen(const Vec3f& p) const {
  const Vec3f from = p - origin_;
  return {double{dot(from, along_)}, sense_ * double{dot(from, across_)}};
}

bool Parting::look_at(const std::array<Vec3f, 3>& base, const Vec3f& chart,
                      std::span<const FaceUnder> faces) {
  origin_ = base[0];
  const Vec3f z = normalized(chart, Vec3f{0, 0, 1});
  const Vec3f aside = std::abs(z.x) < 0.7f ? Vec3f{1, 0, 0} : Vec3f{0, 1, 0};
  along_ = normalized(cross(aside, z), Vec3f{1, 0, 0});
  across_ = cross(z, along_);
  sense_ = 1;
  for (std::size_t k = 0; k < 3; ++k) triangle_[k] = seen(base[k]);
  const double doubled = turn(triangle_[0], triangle_[1], triangle_[2]);
  double longest = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const Point &a = triangle_[k], &b = triangle_[(k + 1) % 3];
    longest = std::max(longest, (b.x - a.x) * (b.x - a.x) + (b.y - a.y) * (b.y - a.y));
  }
  faces_.clear();
  face_rims_.clear();
  rims_ = {};
  if (doubled < 0) {
    sense_ = -1;
    for (Point& p : triangle_) p.y = -p.y;
  }
  for (const FaceUnder& face : faces) {
    Corners& corners = faces_.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) corners[k] = seen(face.corners[k]);
    face_rims_.push_back(face.is_rim);
  }
  touch_rims();
  return std::abs(doubled) > kFlatShare * longest && longest > 0;
}

void Parting::touch_rims() {
  for (std::size_t f = 0; f < faces_.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      if (!face_rims_[f][k]) continue;
      const Point &a = faces_[f][k], &b = faces_[f][(k + 1) % 3];
      const bool is_inside = turn(triangle_[0], triangle_[1], a) >= 0 &&
                             turn(triangle_[1], triangle_[2], a) >= 0 &&
                             turn(triangle_[2], triangle_[0], a) >= 0;
      rims_.is_any |= is_inside;
      for (std::size_t i = 0; i < 3; ++i) {
        const Point &p = triangle_[i], &q = triangle_[(i + 1) % 3];
        if (distance(p, q, a, b) > kRimSlackMetres) continue;
        rims_.is_any = rims_.edges[i] = true;
        if (distance(p, p, a, b) <= kRimSlackMetres) rims_.corners[i] = true;
        if (distance(q, q, a, b) <= kRimSlackMetres) rims_.corners[(i + 1) % 3] = true;
      }
    }
}

void Parting::give(const Polygon& polygon, std::uint32_t face) {
  Part& part = parts_.emplace_back(Part{face, static_cast<std::uint32_t>(points_.size()),
                                        static_cast<std::uint32_t>(polygon.count)});
  const auto shares = [](const Corners& t, const Point& p) {
    const double whole = turn(t[0], t[1], t[2]);
    std::array<double, 3> share{turn(t[1], t[2], p) / whole, turn(t[2], t[0], p) / whole, 0};
    share[2] = 1 - share[0] - share[1];
    double sum = 0;
    for (double& s : share) sum += s = std::clamp(s, 0.0, 1.0);
    for (double& s : share) s /= sum;
    return std::array<float, 3>{float(share[0]), float(share[1]), float(share[2])};
  };
  for (std::size_t i = 0; i < polygon.count; ++i)
    points_.push_back(
        {shares(triangle_, polygon.corner[i]), shares(faces_[face], polygon.corner[i])});
  part.count = static_cast<std::uint32_t>(points_.size()) - part.first;
}

std::uint32_t Parting::nearest_face(const Polygon& polygon) const {
  Point middle;
  for (std::size_t i = 0; i < polygon.count; ++i) {
    middle.x += polygon.corner[i].x / static_cast<double>(polygon.count);
    middle.y += polygon.corner[i].y / static_cast<double>(polygon.count);
  }
  std::uint32_t nearest = 0;
  double least = 1e30;
  for (std::size_t f = 0; f < faces_.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const double apart = distance(middle, middle, faces_[f][k], faces_[f][(k + 1) % 3]);
      if (apart < least) least = apart, nearest = static_cast<std::uint32_t>(f);
    }
  return nearest;
}

void Parting::part() {
  parts_.clear();
  points_.clear();
  if (faces_.empty()) return;
  Polygon whole;
  for (const Point& p : triangle_) whole.add(p);
  const double crumb = kCrumbShare * area(whole);
  rest_.assign(1, whole);
  for (std::size_t f = 0; f < faces_.size() && !rest_.empty(); ++f) {
    const Corners& t = faces_[f];
    const double doubled = turn(t[0], t[1], t[2]);
    if (std::abs(doubled) < 1e-14) continue;  // seen from the side
    // A face is counter-clockwise unless the triangle is mirrored.
    const std::array<std::size_t, 3> order =
        doubled > 0 ? std::array<std::size_t, 3>{0, 1, 2} : std::array<std::size_t, 3>{0, 2, 1};
    next_.clear();
    for (const Polygon& polygon : rest_) {
      if (next_.size() >= kMostPolygons) {
        next_.push_back(polygon);
        continue;
      }
      Polygon inside = polygon, left, right;
      const std::size_t kept = next_.size();
      for (std::size_t k = 0; k < 3 && inside.count > 2; ++k) {
        split(inside, t[order[k]], t[order[(k + 1) % 3]], left, right);
        if (area(right) > crumb) next_.push_back(right);
        inside = left;
      }
      if (inside.count > 2 && area(inside) > crumb) {
        give(inside, static_cast<std::uint32_t>(f));
      } else {
        next_.resize(kept);  // not split at all
        next_.push_back(polygon);
      }
    }
    std::swap(rest_, next_);
  }
  for (const Polygon& polygon : rest_)
    if (area(polygon) > crumb) give(polygon, nearest_face(polygon));
}

}  // namespace trocar::embedding
