#include "tests/cutting/random_strokes.h"

#include <algorithm>
#include <cmath>

namespace trocar::cutting::testing {
namespace {

Vec3d rotated(const Vec3d& v, const Vec3d& axis, double angle) {
  return v * std::cos(angle) + cross(axis, v) * std::sin(angle) +
         axis * (dot(axis, v) * (1 - std::cos(angle)));
}
Vec3d across_of(const Vec3d& v, const Vec3d& other) {
  return normalized(other - v * dot(v, other), Vec3d{1, 0, 0});
}

}  // namespace

RandomStrokes::RandomStrokes(const organ::Organ& organ, double h, std::uint64_t seed)
    : mesh_(organ.mesh), h_(h), normals_(mesh::surface_normals(organ.mesh)), random_(seed) {}

Vec3d RandomStrokes::direction() {
  for (;;) {
    const Vec3d v{random_.between(-1, 1), random_.between(-1, 1), random_.between(-1, 1)};
    if (length(v) > 0.1 && length(v) < 1) return normalized(v, {});
  }
}

StrokeKind RandomStrokes::any_kind() {
  return static_cast<StrokeKind>(random_.below(5));
}

// An edge of one to three segments along `edge` from `start`, swept along `motion`, which turns
// about the edge by `bend` (rad) in all.
Path RandomStrokes::sweep(const Vec3d& start, Vec3d edge, Vec3d motion, double length, double width,
                          double bend) {
  const auto segments = 1 + random_.below(3);
  const double step = std::min(0.005, 0.1 * h_ * std::pow(10, random_.between(-0.7, 0.7)));
  const double bow = segments > 1 ? random_.between(-0.15, 0.15) * width : 0;
  const int steps = static_cast<int>(std::ceil(length / step));
  Path path;
  Vec3d at = start;
  for (int s = 0; s <= steps; ++s) {
    auto& points = path.emplace_back();
    for (std::uint32_t i = 0; i <= segments; ++i) {
      const double t = double(i) / segments;
      points.push_back(at + edge * (t * width) + motion * (4 * bow * t * (1 - t)));
    }
    at += motion * step;
    motion = rotated(motion, edge, bend / steps);
  }
  return path;
}

Path RandomStrokes::knife() {
  const auto node =
      mesh_.surface_nodes[random_.below(static_cast<std::uint32_t>(mesh_.surface_nodes.size()))];
  const Vec3d normal = normals_[node.value], motion = across_of(normal, direction());
  const double depth = random_.between(1.5, 4.5) * h_;
  return sweep(mesh_.rest_positions[node.value] + normal * h_, -normal, motion,
               random_.between(3, 6) * h_, depth + h_,
               random_.below(2) == 0 ? 0 : random_.between(-1, 1));
}

Path RandomStrokes::through() {
  Vec3d low = mesh_.rest_positions[0], high = low;
  for (const auto& p : mesh_.rest_positions) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  const double reach = 0.65 * length(high - low) + h_;
  plane_normal_ = direction();
  plane_point_ = (high - low) * random_.between(-0.15, 0.15);
  const Vec3d edge = across_of(plane_normal_, direction()), motion = cross(plane_normal_, edge);
  return straight_path(
      {plane_point_ - (edge + motion) * reach, plane_point_ + (edge - motion) * reach},
      {plane_point_ - (edge - motion) * reach, plane_point_ + (edge + motion) * reach}, 0.15 * h_);
}

Path RandomStrokes::sawing(const Vec3d& centre) {
  const Vec3d edge = direction(), motion = across_of(edge, direction());
  const Vec3d side = cross(edge, motion);
  Path path;
  for (int tick = 0; tick < 300; ++tick) {
    const Vec3d at = centre + motion * (h_ * std::sin(tick * 0.1)) +
                     side * (0.005 * h_ * random_.between(-1, 1));
    path.push_back({at - edge * (1.5 * h_), at + edge * (1.5 * h_)});
  }
  const Vec3d low = centre - motion * h_, high = centre + motion * h_, half = edge * (1.5 * h_);
  swept_once_ = straight_path({low - half, low + half}, {high - half, high + half}, 0.1 * h_);
  return path;
}

// An inner face: along the surface there is nothing to cut.
Path RandomStrokes::aligned() {
  mesh::Tet tet;
  std::uint32_t first = 0;
  do {
    tet = mesh_.tets[random_.below(static_cast<std::uint32_t>(mesh_.tets.size()))];
    first = random_.below(4);
  } while (std::ranges::any_of(mesh_.boundary_triangles, [&](const mesh::Triangle& triangle) {
    return std::ranges::find(triangle, tet[(first + 3) % 4]) == triangle.end() &&
           std::ranges::all_of(triangle,
                               [&](NodeIndex n) { return std::ranges::find(tet, n) != tet.end(); });
  }));
  const auto place = [&](std::uint32_t corner) {
    return mesh_.rest_positions[tet[(first + corner) % 4].value];
  };
  const Vec3d a = place(0), b = place(1), edge = normalized(b - a, {1, 0, 0});
  const Vec3d motion = across_of(edge, place(2) - a);
  const Vec3d from = a - edge * (random_.between(1, 3) * h_);
  const Vec3d to = b + edge * (random_.between(1, 3) * h_);
  const double step = 0.1 * h_;
  Path path;
  // One of these is on the edge itself.
  for (int s = -20; s <= 30; ++s) {
    const Vec3d by = motion * (step * s);
    path.push_back({from + by, a + by, to + by});
  }
  return path;
}

Path RandomStrokes::crossing() {
  if (knife_.empty()) return knife();
  const auto& middle = knife_[knife_.size() / 2];
  const Vec3d edge = normalized(middle.back() - middle.front(), {1, 0, 0});
  const Vec3d along = across_of(edge, knife_.back().front() - knife_.front().front());
  const double turn = random_.between(1, 2) * (random_.below(2) == 0 ? 1 : -1);
  const Vec3d motion = rotated(along, edge, turn);
  const double size = random_.between(3, 6) * h_;
  return sweep(middle.front() - motion * (size / 2), edge, motion, size,
               length(middle.back() - middle.front()), 0);
}

Path RandomStrokes::next(StrokeKind kind) {
  if (kind == StrokeKind::Knife || kind == StrokeKind::Crossing)
    return swept_once_ = knife_ = kind == StrokeKind::Knife ? knife() : crossing();
  if (kind == StrokeKind::Through) return swept_once_ = through();
  if (kind == StrokeKind::Aligned) return swept_once_ = aligned();
  const auto node = random_.below(static_cast<std::uint32_t>(mesh_.node_count()));
  const Vec3d centre = mesh_.rest_positions[node];
  if (kind == StrokeKind::Sawing) return sawing(centre);
  const Vec3d edge = direction(), motion = across_of(edge, direction());
  const double size = (kind == StrokeKind::Short ? 1 : 3) * h_;
  const double bend = kind == StrokeKind::Curved ? random_.between(-1.5, 1.5) : 0;
  return swept_once_ = sweep(centre - (edge + motion) * (size / 2), edge, motion, size, size, bend);
}

InsideTest::InsideTest(const mesh::TetMesh& mesh) : mesh_(mesh) {
  low_ = mesh.rest_positions[0];
  Vec3d high = low_;
  for (const auto& p : mesh.rest_positions) {
    low_ = {std::min(low_.x, p.x), std::min(low_.y, p.y), std::min(low_.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  const Vec3d extent = high - low_;
  cell_ = std::cbrt(extent.x * extent.y * extent.z / static_cast<double>(mesh.tets.size())) * 2;
  size_ = {static_cast<std::size_t>(extent.x / cell_) + 1,
           static_cast<std::size_t>(extent.y / cell_) + 1,
           static_cast<std::size_t>(extent.z / cell_) + 1};
  cells_.resize(size_[0] * size_[1] * size_[2]);
  const auto place = [&](double value, std::size_t axis) {
    return static_cast<std::size_t>(
        std::clamp(value / cell_, 0.0, static_cast<double>(size_[axis] - 1)));
  };
  for (std::uint32_t t = 0; t < mesh.tets.size(); ++t) {
    Vec3d from = mesh.rest_positions[mesh.tets[t][0].value], to = from;
    for (const auto n : mesh.tets[t]) {
      const auto& p = mesh.rest_positions[n.value];
      from = {std::min(from.x, p.x), std::min(from.y, p.y), std::min(from.z, p.z)};
      to = {std::max(to.x, p.x), std::max(to.y, p.y), std::max(to.z, p.z)};
    }
    from = from - low_, to = to - low_;
    for (auto k = place(from.z, 2); k <= place(to.z, 2); ++k)
      for (auto j = place(from.y, 1); j <= place(to.y, 1); ++j)
        for (auto i = place(from.x, 0); i <= place(to.x, 0); ++i)
          cells_[i + size_[0] * (j + size_[1] * k)].emplace_back(t);
  }
}

bool InsideTest::contains(const Vec3d& p) const {
  const Vec3d at = (p - low_) / cell_;
  if (at.x < 0 || at.y < 0 || at.z < 0) return false;
  const auto i = static_cast<std::size_t>(at.x), j = static_cast<std::size_t>(at.y),
             k = static_cast<std::size_t>(at.z);
  if (i >= size_[0] || j >= size_[1] || k >= size_[2]) return false;
  return std::ranges::any_of(cells_[i + size_[0] * (j + size_[1] * k)], [&](TetIndex t) {
    std::array<Vec3d, 4> corners;
    for (std::size_t c = 0; c < 4; ++c)
      corners[c] = mesh_.rest_positions[mesh_.tets[t.value][c].value];
    for (auto& corner : corners) {
      const auto own = corner;
      corner = p;
      if (six_volumes(corners) < 0) return false;
      corner = own;
    }
    return true;
  });
}

double InsideTest::swept_area(const Path& path, double spacing) const {
  double area = 0;
  for (std::size_t s = 0; s + 1 < path.size(); ++s)
    for (std::size_t i = 0; i + 1 < path[s].size(); ++i) {
      const Vec3d &a = path[s][i], &b = path[s][i + 1], &c = path[s + 1][i],
                  &d = path[s + 1][i + 1];
      const double quad = length(cross(d - a, c - b)) / 2;
      const int n = std::max(1, static_cast<int>(std::ceil(length(b - a) / spacing)));
      int inside = 0;
      for (int k = 0; k < n; ++k) {
        const double t = (k + 0.5) / n;
        inside += contains((a + (b - a) * t + c + (d - c) * t) / 2);
      }
      area += quad * inside / n;
    }
  return area;
}

double InsideTest::length_inside(const Vec3d& a, const Vec3d& b, double spacing) const {
  const int n = std::max(1, static_cast<int>(std::ceil(length(b - a) / spacing)));
  int inside = 0;
  for (int k = 0; k < n; ++k) inside += contains(a + (b - a) * ((k + 0.5) / n));
  return length(b - a) * inside / n;
}

double InsideTest::perimeter(const Path& path, double spacing) const {
  double border = 0, steps = 0;
  for (const auto* const edge : {&path.front(), &path.back()})
    for (std::size_t i = 0; i + 1 < edge->size(); ++i)
      border += length_inside((*edge)[i], (*edge)[i + 1], spacing);
  std::vector<char> before, now;
  for (std::size_t s = 0; s < path.size(); ++s) {
    now.clear();
    const auto& edge = path[s];
    double motion = 0;
    if (s > 0) {
      motion = length(edge.front() - path[s - 1].front());
      border += length_inside(path[s - 1].front(), edge.front(), spacing);
      border += length_inside(path[s - 1].back(), edge.back(), spacing);
    }
    for (std::size_t i = 0; i + 1 < edge.size(); ++i) {
      // The number of samples is the same for every edge of the path.
      const double segment = length(path[0][i + 1] - path[0][i]);
      const int n = std::max(1, static_cast<int>(std::ceil(segment / spacing)));
      for (int k = 0; k < n; ++k) {
        now.push_back(contains(edge[i] + (edge[i + 1] - edge[i]) * ((k + 0.5) / n)));
        if (now.size() > 1 && now.back() != now[now.size() - 2]) steps += motion;
        if (s > 0 && now.back() != before[now.size() - 1]) steps += segment / n;
      }
    }
    before = now;
  }
  return border + M_PI / 4 * steps;
}

}  // namespace trocar::cutting::testing
