#include "client/shape/smooth_surface.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace trocar::shape {

void compute_normals(std::span<const Vec3f> positions, std::span<const TriangleCorners> triangles,
                     std::vector<Vec3f>& normals) {
  normals.assign(positions.size(), Vec3f{});
  for (const auto& [a, b, c] : triangles) {
    // Twice the area long, so that the sum is weighted by area.
    const Vec3f n = cross(positions[b] - positions[a], positions[c] - positions[a]);
    normals[a] += n;
    normals[b] += n;
    normals[c] += n;
  }
  for (Vec3f& n : normals) n = normalized(n * 1e6f, Vec3f{0, 1, 0});
}

void SmoothSurface::EdgeTable::clear(std::size_t most_edges) {
  const std::size_t size = std::bit_ceil(std::max<std::size_t>(2 * most_edges, 16));
  slots_.assign(size, Slot{});
  shift_ = 64 - static_cast<unsigned>(std::countr_zero(size));
}

std::uint32_t& SmoothSurface::EdgeTable::at(std::uint32_t a, std::uint32_t b) {
  const std::uint64_t key = std::uint64_t{std::min(a, b)} << 32 | std::max(a, b);
  // This is Fibonacci hashing (Knuth vol. 3, 6.4).
  std::size_t i = static_cast<std::size_t>(key * 0x9e3779b97f4a7c15u >> shift_);
  while (slots_[i].key != key && slots_[i].key != kEmpty) i = (i + 1) & (slots_.size() - 1);
  slots_[i].key = key;
  return slots_[i].value;
}

// Outer triangles as they are, then the wound's with their own copies of rim vertices.
void SmoothSurface::split_rim(std::span<const TriangleCorners> triangles,
                              std::span<const std::uint8_t> is_wound) {
  coarse_triangles_.clear();
  wound_of_.assign(coarse_vertex_count_, kNone);
  outer_of_.assign(coarse_vertex_count_, kNone);
  vertex_is_wound_.assign(coarse_vertex_count_, 0);
  rim_.clear();
  const auto is_outer = [&](std::size_t i) { return i >= is_wound.size() || is_wound[i] == 0; };
  const auto is_gap = [](const TriangleCorners& t) { return t[0] == t[1]; };
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    if (!is_outer(i) || is_gap(triangles[i])) continue;
    coarse_triangles_.push_back(triangles[i]);
    for (const std::uint32_t v : triangles[i]) outer_of_[v] = v;
  }
  first_wound_triangle_ = coarse_triangles_.size();
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    if (is_outer(i) || is_gap(triangles[i])) continue;
    TriangleCorners& corners = coarse_triangles_.emplace_back(triangles[i]);
    for (std::uint32_t& v : corners) {
      std::uint32_t& drawn_as = wound_of_[v];
      if (drawn_as == kNone && outer_of_[v] == kNone) {
        drawn_as = v;
        vertex_is_wound_[v] = 1;
      } else if (drawn_as == kNone) {
        drawn_as = static_cast<std::uint32_t>(coarse_vertex_count_ + rim_.size());
        rim_.push_back(v);
        outer_of_.push_back(v);
        vertex_is_wound_.push_back(1);
      }
      v = drawn_as;
    }
  }
}

std::uint32_t SmoothSurface::midpoint(std::uint32_t a, std::uint32_t b) {
  std::uint32_t& value = edges_.at(a, b);
  if (value != kNone) return value;
  value = static_cast<std::uint32_t>(vertex_count());
  const std::uint32_t made = value;
  const bool is_on_wound = vertex_is_wound_[a] != 0;
  std::uint32_t outside = kNone;
  // An edge of the wound between two rim vertices is on the rim if the outside, which went before,
  // has it too.
  if (!is_on_wound)
    outside = made;
  else if (outer_of_[a] != kNone && outer_of_[b] != kNone)
    outside = edges_.at(outer_of_[a], outer_of_[b]);
  midpoints_.push_back({a, b, is_on_wound ? outside : kNone});
  outer_of_.push_back(outside);
  vertex_is_wound_.push_back(is_on_wound);
  return made;
}

void SmoothSurface::halve_edges() {
  edges_.clear(3 * fine_triangles_.size());
  finer_.clear();
  finer_.reserve(fine_triangles_.size() * 4);
  for (const auto& [a, b, c] : fine_triangles_) {
    const std::uint32_t ab = midpoint(a, b), bc = midpoint(b, c), ca = midpoint(c, a);
    finer_.insert(finer_.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
  }
  std::swap(fine_triangles_, finer_);
}

void SmoothSurface::build(std::size_t vertex_count, std::span<const TriangleCorners> triangles,
                          std::span<const std::uint8_t> is_wound, std::size_t triangle_budget) {
  coarse_vertex_count_ = vertex_count;
  lifts_.clear();
  midpoints_.clear();
  split_rim(triangles, is_wound);
  fine_triangles_ = coarse_triangles_;
  rim_midpoints_.clear();
  for (int level = 0; level < 2 && fine_triangles_.size() * 4 <= triangle_budget; ++level) {
    const std::size_t first = midpoints_.size();
    halve_edges();
    follow_rim(first);
  }
  is_rim_.assign(this->vertex_count(), 0);
  for (const std::uint32_t v : rim_) is_rim_[v] = 1;
  for (const Midpoint& m : midpoints_)
    if (m.same_as != kNone) is_rim_[m.same_as] = 1;
}

// A vertex lies on a border where its faces turn away from each other. It is drawn towards the mean
// of its neighbours that lie on the border, too.
void SmoothSurface::smooth_borders(std::span<const Vec3f> rest) {
  constexpr float kSharp = 0.80f;  // the cosine between a face and the mean of those around it
  constexpr int kSteps = 3;
  constexpr std::size_t kLeastFaces = 4;  // vertices for each that lies on a border
  const auto outer = std::span(coarse_triangles_).first(first_wound_triangle_);
  std::vector<Vec3f> normals;
  compute_normals(rest, outer, normals);
  std::vector<std::uint8_t> is_border(rest.size(), 0);
  for (const auto& t : outer) {
    const Vec3f face =
        normalized(cross(rest[t[1]] - rest[t[0]], rest[t[2]] - rest[t[0]]) * 1e6f, normals[t[0]]);
    for (const std::uint32_t v : t)
      if (dot(face, normals[v]) < kSharp) is_border[v] = 1;
  }
  for (const std::uint32_t v : rim_) is_border[v] = 0;
  // A body that is all borders is meant to be: boxes, rods.
  const auto borders = static_cast<std::size_t>(std::ranges::count(is_border, 1));
  if (borders * kLeastFaces > rest.size()) return;
  std::vector<Vec3f> places(rest.begin(), rest.end()), sums;
  std::vector<float> counts;
  for (int step = 0; step < kSteps; ++step) {
    sums.assign(rest.size(), Vec3f{});
    counts.assign(rest.size(), 0);
    for (const auto& t : outer)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = t[k], b = t[(k + 1) % 3];
        if (is_border[a] == 0 || is_border[b] == 0) continue;
        // Each edge comes twice, once for either triangle beside it.
        sums[a] += places[b], counts[a] += 1;
        sums[b] += places[a], counts[b] += 1;
      }
    for (std::size_t v = 0; v < rest.size(); ++v)
      if (counts[v] >= 4) places[v] = (places[v] + sums[v] / counts[v]) * 0.5f;
  }
  lifts_.assign(rest.size(), 0);
  for (std::size_t v = 0; v < rest.size(); ++v)
    lifts_[v] = std::clamp(dot(places[v] - rest[v], normals[v]), -kMostLiftMetres, kMostLiftMetres);
}

// Each edge of the rim that was halved last learns where the rim goes on at its ends.
void SmoothSurface::follow_rim(std::size_t first_midpoint) {
  constexpr std::uint32_t kFork = kNone - 1;
  const std::size_t first_rim = rim_midpoints_.size();
  for (std::size_t i = first_midpoint; i < midpoints_.size(); ++i)
    if (const Midpoint& m = midpoints_[i]; m.same_as != kNone) {
      const Midpoint& outer = midpoints_[m.same_as - coarse_vertex_count_ - rim_.size()];
      rim_midpoints_.push_back({.vertex = m.same_as, .a = outer.a, .b = outer.b});
    }
  std::sort(rim_midpoints_.begin() + static_cast<std::ptrdiff_t>(first_rim), rim_midpoints_.end(),
            [](const RimMidpoint& a, const RimMidpoint& b) { return a.vertex < b.vertex; });
  const std::span<RimMidpoint> edges = std::span(rim_midpoints_).subspan(first_rim);
  if (edges.empty()) return;
  along_rim_.assign(coarse_vertex_count_ + rim_.size() + first_midpoint, {kNone, kNone});
  const auto join = [&](std::uint32_t from, std::uint32_t to) {
    auto& [one, other] = along_rim_[from];
    if (one == kNone)
      one = to;
    else
      other = other == kNone ? to : kFork;
  };
  for (const RimMidpoint& m : edges) join(m.a, m.b), join(m.b, m.a);
  const auto beyond = [&](std::uint32_t at, std::uint32_t from) {
    const auto& [one, other] = along_rim_[at];
    if (other == kFork) return kNone;
    return one == from ? other : one;
  };
  for (RimMidpoint& m : edges) m.before = beyond(m.a, m.b), m.after = beyond(m.b, m.a);
}

// By area. A lip leaves out a wall whose triangles do not agree, as at the end of a cut.
void SmoothSurface::compute_coarse_normals() {
  compute_normals(positions_, coarse_triangles_, bends_);
  lips_ = bends_;
  for (int i = 0; i < 2 && !rim_.empty(); ++i) average_walls();
  normals_ = lips_;
  if (rim_.empty()) return;
  // How far each wall agrees with itself: 1 where all its triangles face one way.
  spread_.assign(positions_.size(), Vec3f{});
  for (const auto& t : walls()) {
    const Vec3f n = cross(positions_[t[1]] - positions_[t[0]], positions_[t[2]] - positions_[t[0]]);
    const float size = length(n);
    for (const std::uint32_t v : t) spread_[v] += Vec3f{dot(n, normals_[v]), size, 0} * 1e6f;
  }
  for (std::size_t i = 0; i < rim_.size(); ++i) {
    const std::size_t wall = coarse_vertex_count_ + i;
    const float agrees = std::max(0.0f, spread_[wall].x / std::max(spread_[wall].y, 1e-6f));
    Vec3f& outside = lips_[rim_[i]];
    outside = normalized(outside + lips_[wall] * agrees, outside);
    lips_[wall] = outside;
  }
  average_walls();
  for (std::size_t i = 0; i < rim_.size(); ++i) lips_[coarse_vertex_count_ + i] = lips_[rim_[i]];
  for (std::size_t v = 0; v < coarse_vertex_count_; ++v)
    if (vertex_is_wound_[v] != 0) normals_[v] = lips_[v];
}

// Gives each vertex of a wall the mean of the lips around it.
void SmoothSurface::average_walls() {
  spread_.assign(positions_.size(), Vec3f{});
  for (const auto& t : walls()) {
    const Vec3f n = cross(positions_[t[1]] - positions_[t[0]], positions_[t[2]] - positions_[t[0]]);
    const Vec3f sum = (lips_[t[0]] + lips_[t[1]] + lips_[t[2]]) * (length(n) * 1e6f);
    for (const std::uint32_t v : t) spread_[v] += sum;
  }
  for (std::size_t v = 0; v < lips_.size(); ++v)
    if (vertex_is_wound_[v] != 0) lips_[v] = normalized(spread_[v], lips_[v]);
}

// A rim that turns by more than a right angle has a corner there, and is not rounded over it.
Vec3f SmoothSurface::rim_position(const RimMidpoint& m) const {
  const Vec3f a = positions_[m.a], b = positions_[m.b], edge = b - a;
  const auto goes_on = [&](std::uint32_t beyond, const Vec3f& end, const Vec3f& way) {
    return beyond != kNone && dot(positions_[beyond] - end, way) > 0;
  };
  const Vec3f before = goes_on(m.before, a, -edge) ? positions_[m.before] : a - edge;
  const Vec3f after = goes_on(m.after, b, edge) ? positions_[m.after] : b + edge;
  return (a + b) * 0.5625f - (before + after) * 0.0625f;
}

void SmoothSurface::update(std::span<const Vec3f> coarse_positions) {
  positions_.assign(coarse_positions.begin(), coarse_positions.end());
  positions_.reserve(vertex_count());
  for (const std::uint32_t vertex : rim_) positions_.push_back(positions_[vertex]);
  compute_coarse_normals();
  if (!lifts_.empty()) {
    for (std::size_t v = 0; v < coarse_vertex_count_; ++v)
      if (lifts_[v] != 0) positions_[v] += bends_[v] * lifts_[v];
    compute_coarse_normals();
  }
  normals_.reserve(vertex_count());
  lips_.reserve(vertex_count());
  bends_.reserve(vertex_count());
  auto rim = rim_midpoints_.begin();
  for (const Midpoint& m : midpoints_) {
    const Vec3f na = bends_[m.a], nb = bends_[m.b];
    const bool is_on_rim = rim != rim_midpoints_.end() && rim->vertex == positions_.size();
    if (m.same_as != kNone) {
      positions_.push_back(positions_[m.same_as]);
    } else if (is_on_rim) {
      positions_.push_back(rim_position(*rim++));
    } else {
      const Vec3f edge = positions_[m.b] - positions_[m.a];
      const float bend_a = dot(edge, na), bend_b = -dot(edge, nb);
      positions_.push_back((positions_[m.a] + positions_[m.b]) * 0.5f -
                           (na * bend_a + nb * bend_b) * 0.125f);
    }
    bends_.push_back(normalized(na + nb, na));
    normals_.push_back(normalized(normals_[m.a] + normals_[m.b], normals_[m.a]));
    if (m.same_as != kNone)
      lips_.push_back(lips_[m.same_as]);
    else if (is_on_rim)
      lips_.push_back(normalized(lips_[m.a] + lips_[m.b], lips_[m.a]));
    else
      lips_.push_back(normals_.back());
  }
}

void SmoothSurface::measure_rim(float most_m, std::vector<float>& distances) const {
  // Each vertex learns from its neighbours which vertex of the rim is nearest.
  std::vector<std::uint32_t> nearest(vertex_count(), kNone);
  distances.assign(vertex_count(), most_m);
  const auto put = [&](std::uint32_t v) { nearest[v] = v, distances[v] = 0; };
  for (std::uint32_t i = 0; i < rim_.size(); ++i) {
    put(rim_[i]);
    put(static_cast<std::uint32_t>(coarse_vertex_count_) + i);
  }
  for (std::uint32_t i = 0; i < midpoints_.size(); ++i)
    if (midpoints_[i].same_as != kNone) {
      put(midpoints_[i].same_as);
      put(static_cast<std::uint32_t>(coarse_vertex_count_ + rim_.size()) + i);
    }
  for (bool changed = true; changed;) {
    changed = false;
    for (const auto& t : fine_triangles_)
      for (std::size_t k = 0; k < 6; ++k) {  // each edge in both directions
        const std::uint32_t source = nearest[t[k % 3]];
        const std::uint32_t v = t[(k + 1 + k / 3) % 3];
        if (source == kNone || source == nearest[v]) continue;
        const float apart = length(positions_[v] - positions_[source]);
        if (!(apart < distances[v])) continue;
        nearest[v] = source, distances[v] = apart;
        changed = true;
      }
  }
}

}  // namespace trocar::shape
