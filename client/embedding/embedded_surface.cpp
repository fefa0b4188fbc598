#include "client/embedding/embedded_surface.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <utility>

namespace trocar::embedding {
namespace {

constexpr float kAtCorner = 1e-4f;        // shares of a fine triangle: as good as none
constexpr float kOnEdge = 1e-3f;          // likewise, of a face
constexpr float kSkirtShare = 0.12f;      // of the edge of a rim: so far a skirt reaches below it
constexpr float kLeastFacing = 0.1f;      // cosine of a face that lies under a triangle
constexpr float kUnderSlackEdges = 0.5f;  // mean fine edges: a coarse face so near is under it
constexpr std::size_t kMostUnder = 256;
constexpr std::size_t kMostLookedUnder = 16'384;  // cells and faces, for those under a triangle

float mean_edge(std::span<const Vec3f> positions, std::span<const TriangleCorners> triangles) {
  double sum = 0;
  std::size_t count = 0;
  for (const auto& [a, b, c] : triangles) {
    if (a == b) continue;
    sum += double{length(positions[b] - positions[a])} +
           double{length(positions[c] - positions[b])} +
           double{length(positions[a] - positions[c])};
    count += 3;
  }
  return count == 0 ? 1.0f : static_cast<float>(sum / static_cast<double>(count));
}

// Sums the normals of the triangles around each place: vertices there that differ in the picture's
// place alone, along its seams, have one normal.
std::vector<Vec3f> normals_of(const FineShape& shape) {
  std::vector<Vec3f> normals(shape.positions.size());
  for (const auto& [a, b, c] : shape.triangles) {
    const Vec3f n =
        cross(shape.positions[b] - shape.positions[a], shape.positions[c] - shape.positions[a]);
    for (const std::uint32_t v : {a, b, c}) normals[v] += n * 1e6f;
  }
  std::vector<std::uint32_t> order(normals.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto place = [&](std::uint32_t v) {
    const Vec3f& p = shape.positions[v];
    return std::array<float, 3>{p.x, p.y, p.z};
  };
  std::sort(order.begin(), order.end(), [&](std::uint32_t v, std::uint32_t w) {
    return std::pair(place(v), v) < std::pair(place(w), w);
  });
  for (std::size_t first = 0, end = 0; first < order.size(); first = end) {
    Vec3f sum;
    for (; end < order.size() && place(order[end]) == place(order[first]); ++end)
      sum += normals[order[end]];
    for (std::size_t i = first; i < end; ++i) normals[order[i]] = normalized(sum, Vec3f{0, 1, 0});
  }
  return normals;
}

}  // namespace

void EmbeddedSurface::EdgeSet::clear(std::size_t most) {
  const std::size_t size = std::bit_ceil(std::max<std::size_t>(2 * most, 16));
  slots_.assign(size, ~std::uint64_t{0});
  shift_ = 64 - static_cast<unsigned>(std::countr_zero(size));
}

std::size_t EmbeddedSurface::EdgeSet::find(std::uint64_t key) const {
  // This is Fibonacci hashing (Knuth vol. 3, 6.4).
  auto i = static_cast<std::size_t>(key * 0x9e3779b97f4a7c15u >> shift_);
  while (slots_[i] != key && slots_[i] != ~std::uint64_t{0}) i = (i + 1) & (slots_.size() - 1);
  return i;
}

void EmbeddedSurface::EdgeSet::insert(std::uint32_t a, std::uint32_t b) {
  const std::uint64_t key = std::uint64_t{a} << 32 | b;
  slots_[find(key)] = key;
}

bool EmbeddedSurface::EdgeSet::has(std::uint32_t a, std::uint32_t b) const {
  const std::uint64_t key = std::uint64_t{a} << 32 | b;
  return slots_[find(key)] == key;
}

EmbeddedSurface::EmbeddedSurface(FineShape shape) : shape_(std::move(shape)) {
  shape_normals_ = normals_of(shape_);
  const float edge_m = mean_edge(shape_.positions, shape_.triangles);
  under_slack_m_ = kUnderSlackEdges * edge_m;
  shape_grid_.build(shape_.positions, shape_.triangles, 2 * edge_m);
  face_of_.assign(shape_.positions.size(), kNoFace);
  is_affected_.assign(shape_.triangles.size(), 0);
  is_parted_.assign(shape_.triangles.size(), 0);
  vertices_.resize(shape_.positions.size());
  looks_.resize(shape_.positions.size());
  for (std::size_t v = 0; v < shape_.positions.size(); ++v) {
    vertices_[v].normal = shape_normals_[v];
    looks_[v].rest = shape_.positions[v];
    if (!shape_.texture.empty()) looks_[v].texture = shape_.texture[v];
  }
}

Vec3f EmbeddedSurface::normal_of(std::uint32_t face) const {
  const auto& [a, b, c] = coarse_[face];
  return normalized(cross(rest_[b] - rest_[a], rest_[c] - rest_[a]) * 1e6f, Vec3f{});
}

// Finds which triangles of the outside are no longer as they were, and takes the new surface over.
void EmbeddedSurface::note_changes(const CoarseShape& coarse) {
  is_all_new_ = coarse_.empty() || coarse.rest.size() < rest_.size() ||
                coarse.triangles.size() < coarse_.size() ||
                !std::equal(rest_.begin(), rest_.end(), coarse.rest.begin());
  changed_boxes_.clear();
  rest_.assign(coarse.rest.begin(), coarse.rest.end());
  coarse_.resize(coarse.triangles.size());
  faces_.clear();
  const auto add_changed = [this](const TriangleCorners& face) {
    if (face[0] == face[1]) return;
    Box<float>& box = changed_boxes_.emplace_back();
    for (const std::uint32_t v : face) box.include(rest_[v]);
  };
  for (std::uint32_t i = 0; i < coarse_.size(); ++i) {
    const TriangleCorners& now = coarse.triangles[i];
    const bool is_outer =
        now[0] != now[1] && (i >= coarse.is_wound.size() || coarse.is_wound[i] == 0);
    const TriangleCorners before = std::exchange(coarse_[i], is_outer ? now : TriangleCorners{});
    if (is_outer) faces_.push_back(i);
    if (is_all_new_ || coarse_[i] == before) continue;
    add_changed(before);
    add_changed(coarse_[i]);
  }
}

void EmbeddedSurface::add_affected(std::uint32_t triangle) {
  if (std::exchange(is_affected_[triangle], 1) == 0) affected_.push_back(triangle);
}

void EmbeddedSurface::find_affected() {
  affected_.clear();
  if (is_all_new_) {
    for (std::uint32_t t = 0; t < shape_.triangles.size(); ++t) add_affected(t);
    return;
  }
  for (Box<float> box : changed_boxes_) {
    box.grow(farthest_m_ + under_slack_m_ + 2 * static_cast<float>(kRimSlackMetres));
    found_.clear();
    shape_grid_.find(box, found_);
    for (const std::uint32_t t : found_) add_affected(t);
  }
}

void EmbeddedSurface::bind(std::uint32_t vertex) {
  const FacePlace place = grid_.nearest(shape_.positions[vertex], shape_normals_[vertex]);
  face_of_[vertex] = place.face;
  Vertex& v = vertices_[vertex];
  if (place.face == kNoFace) {
    // It is nowhere near, which no organ's own surface is: any vertex carries it.
    v.corner = {};
    v.weight = {1, 0, 0};
    v.offset = shape_.positions[vertex] - rest_[0];
    return;
  }
  v.corner = coarse_[place.face];
  v.weight = place.weight;
  Vec3f base;
  for (std::size_t k = 0; k < 3; ++k) base += rest_[v.corner[k]] * v.weight[k];
  v.offset = shape_.positions[vertex] - base;
  farthest_m_ = std::max(farthest_m_, place.distance_m);
}

// Parts of fine triangles around which nothing has changed move up.
void EmbeddedSurface::keep_unaffected() {
  next_parted_.clear();
  next_vertices_.clear();
  next_looks_.clear();
  next_part_triangles_.clear();
  const std::size_t fine = shape_.positions.size();
  for (Parted parted : parted_) {
    if (is_affected_[parted.triangle] != 0) {
      is_parted_[parted.triangle] = 0;
      continue;
    }
    const auto first = static_cast<std::ptrdiff_t>(fine + parted.first_vertex);
    const auto last = first + static_cast<std::ptrdiff_t>(parted.vertices);
    parted.first_vertex = static_cast<std::uint32_t>(next_vertices_.size());
    next_vertices_.insert(next_vertices_.end(), vertices_.begin() + first,
                          vertices_.begin() + last);
    next_looks_.insert(next_looks_.end(), looks_.begin() + first, looks_.begin() + last);
    const auto face = part_triangles_.begin() + static_cast<std::ptrdiff_t>(parted.first_face);
    parted.first_face = static_cast<std::uint32_t>(next_part_triangles_.size());
    next_part_triangles_.insert(next_part_triangles_.end(), face,
                                face + static_cast<std::ptrdiff_t>(parted.faces + parted.skirts));
    next_parted_.push_back(parted);
  }
}

void EmbeddedSurface::follow(const CoarseShape& coarse) {
  note_changes(coarse);
  if (rest_.empty()) return;
  is_stale_ = true;
  grid_.build(rest_, coarse_, mean_edge(rest_, coarse_));
  edges_.clear(3 * faces_.size());
  for (const std::uint32_t face : faces_)
    for (std::size_t k = 0; k < 3; ++k) edges_.insert(coarse_[face][k], coarse_[face][(k + 1) % 3]);
  frames_.build(rest_, coarse_, faces_);
  find_affected();
  if (is_all_new_) farthest_m_ = 0;
  // One that still has its face is bound anew, too: a new face may be as near, and who joins late
  // knows nothing of the old ones.
  for (const std::uint32_t t : affected_)
    for (const std::uint32_t v : shape_.triangles[t]) face_of_[v] = kNoFace;
  for (const std::uint32_t t : affected_)
    for (const std::uint32_t v : shape_.triangles[t])
      if (face_of_[v] == kNoFace) bind(v);
  keep_unaffected();
  for (const std::uint32_t t : affected_) settle(t);
  for (const std::uint32_t t : affected_) is_affected_[t] = 0;
  std::swap(parted_, next_parted_);
  std::swap(part_triangles_, next_part_triangles_);
  const auto fine = static_cast<std::ptrdiff_t>(shape_.positions.size());
  vertices_.erase(vertices_.begin() + fine, vertices_.end());
  vertices_.insert(vertices_.end(), next_vertices_.begin(), next_vertices_.end());
  looks_.erase(looks_.begin() + fine, looks_.end());
  looks_.insert(looks_.end(), next_looks_.begin(), next_looks_.end());
  list_triangles();
}

void EmbeddedSurface::find_faces_under(std::uint32_t triangle, const Vec3f& chart) {
  Box<float> box;
  for (const std::uint32_t v : shape_.triangles[triangle])
    box.include(shape_.positions[v] - vertices_[v].offset);
  box.grow(under_slack_m_ + static_cast<float>(kRimSlackMetres));
  found_.clear();
  grid_.find(box, found_, kMostLookedUnder);
  // In one order, so that who joins late gets the same parts.
  std::sort(found_.begin(), found_.end());
  under_.clear();
  faces_under_.clear();
  for (const std::uint32_t face : found_) {
    if (under_.size() >= kMostUnder) break;
    if (!(dot(normal_of(face), chart) > kLeastFacing)) continue;
    under_.push_back(face);
    FaceUnder& under = faces_under_.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      under.corners[k] = rest_[coarse_[face][k]];
      under.is_rim[k] = !edges_.has(coarse_[face][(k + 1) % 3], coarse_[face][k]);
    }
  }
}

// Leaves a triangle whole, or parts it.
void EmbeddedSurface::settle(std::uint32_t triangle) {
  const TriangleCorners& corners = shape_.triangles[triangle];
  std::array<Vec3f, 3> base;
  Vec3f chart;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t v = corners[k];
    if (face_of_[v] == kNoFace) return;
    base[k] = shape_.positions[v] - vertices_[v].offset;
    chart += normal_of(face_of_[v]);
  }
  if (length(chart) < 0.3f) chart = cross(base[1] - base[0], base[2] - base[0]) * 1e6f;
  chart = normalized(chart, shape_normals_[corners[0]]);
  find_faces_under(triangle, chart);
  const bool has_area = parting_.look_at(base, chart, faces_under_);
  if (!parting_.rims().is_any || faces_under_.empty()) return;
  if (next_vertices_.size() >= kMostPartVertices) return;
  if (has_area) parting_.part();
  if (has_area && !parting_.parts().empty()) return add_parts(triangle);
  add_whole(triangle, base);
}

// A triangle that is too slender to be parted rides on the face of its first corner alone.
void EmbeddedSurface::add_whole(std::uint32_t triangle, const std::array<Vec3f, 3>& base) {
  Parted& parted = begin_parts(triangle);
  const std::uint32_t face = face_of_[shape_.triangles[triangle][0]];
  const auto& [a, b, c] = coarse_[face];
  TriangleCorners corners{};
  for (std::size_t k = 0; k < 3; ++k) {
    PartPoint point;
    point.share[k] = 1;
    point.weight = nearest_on(base[k], rest_[a], rest_[b], rest_[c]).weight;
    corners[k] = add_point(triangle, point, face, true);
  }
  next_part_triangles_.push_back(corners);
  parted.faces = 1;
  parted.vertices = static_cast<std::uint32_t>(next_vertices_.size()) - parted.first_vertex;
}

EmbeddedSurface::Parted& EmbeddedSurface::begin_parts(std::uint32_t triangle) {
  is_parted_[triangle] = 1;
  Parted& parted = next_parted_.emplace_back();
  parted.triangle = triangle;
  parted.first_vertex = static_cast<std::uint32_t>(next_vertices_.size());
  parted.first_face = static_cast<std::uint32_t>(next_part_triangles_.size());
  return parted;
}

// Whether a place on a face is on its edge from corner `edge` to the next.
bool EmbeddedSurface::is_on_edge(const PartPoint& point, std::uint32_t face,
                                 std::size_t edge) const {
  const auto& corners = coarse_[face];
  const Vec3f a = rest_[corners[edge]], b = rest_[corners[(edge + 1) % 3]],
              c = rest_[corners[(edge + 2) % 3]];
  const float height = length(cross(b - a, c - a)) / std::max(length(b - a), 1e-9f);
  const float slack = static_cast<float>(kRimSlackMetres) / std::max(height, 1e-9f);
  return point.weight[(edge + 2) % 3] <= std::max(kOnEdge, slack);
}

// Returns the corner of a part: a vertex of the surface as given where no rim is near, else one of
// its own on that face.
std::uint32_t EmbeddedSurface::add_point(std::uint32_t triangle, const PartPoint& point,
                                         std::uint32_t face, bool is_own) {
  const TriangleCorners& corners = shape_.triangles[triangle];
  const RimTouch& rims = parting_.rims();
  Vertex vertex;
  Look look;
  for (std::size_t k = 0; k < 3; ++k) {
    if (!is_own && point.share[k] > 1 - kAtCorner && !rims.corners[k]) return corners[k];
    const std::uint32_t v = corners[k];
    look.rest += shape_.positions[v] * point.share[k];
    vertex.normal += shape_normals_[v] * point.share[k];
    if (!shape_.texture.empty())
      for (std::size_t axis = 0; axis < 2; ++axis)
        look.texture[axis] += shape_.texture[v][axis] * point.share[k];
  }
  vertex.normal = normalized(vertex.normal, Vec3f{0, 1, 0});
  // On an edge that no rim comes near, the neighbour is whole, and its edge is straight.
  std::size_t opposite = 3;
  for (std::size_t k = 0; k < 3 && !is_own; ++k)
    if (point.share[k] < kAtCorner && !rims.edges[(k + 1) % 3]) opposite = k;
  if (opposite < 3) {
    const std::size_t a = (opposite + 1) % 3, b = (opposite + 2) % 3;
    const float t = point.share[b] / std::max(point.share[a] + point.share[b], 1e-6f);
    vertex.corner = {corners[a], corners[b], kBetween};
    vertex.weight = {1 - t, t, 0};
  } else {
    vertex.corner = coarse_[face];
    vertex.weight = point.weight;
    Vec3f base;
    for (std::size_t k = 0; k < 3; ++k) base += rest_[vertex.corner[k]] * vertex.weight[k];
    vertex.offset = look.rest - base;
    farthest_m_ = std::max(farthest_m_, length(vertex.offset));
    for (std::size_t k = 0; k < 3; ++k)
      if (!edges_.has(vertex.corner[(k + 1) % 3], vertex.corner[k]) && is_on_edge(point, face, k))
        look.rim = -1;
  }
  next_vertices_.push_back(vertex);
  next_looks_.push_back(look);
  return static_cast<std::uint32_t>(shape_.positions.size() + next_vertices_.size() - 1 -
                                    next_parted_.back().first_vertex);
}

void EmbeddedSurface::add_parts(std::uint32_t triangle) {
  Parted& parted = begin_parts(triangle);
  for (const Part& part : parting_.parts()) {
    part_indices_.clear();
    for (std::uint32_t i = 0; i < part.count; ++i)
      part_indices_.push_back(
          add_point(triangle, parting_.points()[part.first + i], under_[part.face], false));
    for (std::size_t i = 2; i < part_indices_.size(); ++i)
      next_part_triangles_.push_back({part_indices_[0], part_indices_[i - 1], part_indices_[i]});
  }
  parted.faces = static_cast<std::uint32_t>(next_part_triangles_.size()) - parted.first_face;
  for (const Part& part : parting_.parts()) add_skirt(triangle, part, under_[part.face]);
  parted.skirts =
      static_cast<std::uint32_t>(next_part_triangles_.size()) - parted.first_face - parted.faces;
  parted.vertices = static_cast<std::uint32_t>(next_vertices_.size()) - parted.first_vertex;
}

// Joins each edge of a part that lies on a rim with the rim below it. The wall looks into the
// wound.
void EmbeddedSurface::add_skirt(std::uint32_t triangle, const Part& part, std::uint32_t face) {
  const TriangleCorners& corners = coarse_[face];
  const Vec3f normal = normal_of(face);
  const auto fine = static_cast<std::uint32_t>(shape_.positions.size());
  const auto point = [&](std::uint32_t i) -> const PartPoint& {
    return parting_.points()[part.first + i % part.count];
  };
  for (std::size_t k = 0; k < 3; ++k) {
    if (!faces_under_[part.face].is_rim[k]) continue;
    const Vec3f edge = rest_[corners[(k + 1) % 3]] - rest_[corners[k]];
    // The rim of the wound is drawn as a curve, which may lie lower than its edge.
    const Vec3f below = normal * (-kSkirtShare * length(edge));
    const Vec3f sideways = cross(normalized(edge * 1e3f, Vec3f{}), normal);
    for (std::uint32_t i = 0; i < part.count; ++i) {
      if (!is_on_edge(point(i), face, k) || !is_on_edge(point(i + 1), face, k)) continue;
      const std::size_t first = next_vertices_.size();
      for (const std::uint32_t end : {i, i + 1}) {
        const PartPoint& p = point(end);
        Vertex vertex;
        vertex.corner = corners;
        vertex.weight = p.weight;
        vertex.normal = sideways;
        Vec3f base, top;
        for (std::size_t n = 0; n < 3; ++n) {
          base += rest_[corners[n]] * p.weight[n];
          top += shape_.positions[shape_.triangles[triangle][n]] * p.share[n];
        }
        vertex.offset = top - base;
        next_vertices_.push_back(vertex);
        next_looks_.push_back({top, 1, {}});
        vertex.offset = below;
        next_vertices_.push_back(vertex);
        next_looks_.push_back({base + below, 1, {}});
      }
      const auto at = fine + static_cast<std::uint32_t>(first) - next_parted_.back().first_vertex;
      next_part_triangles_.push_back({at, at + 1, at + 2});
      next_part_triangles_.push_back({at + 1, at + 3, at + 2});
    }
  }
}

void EmbeddedSurface::list_triangles() {
  const auto fine = static_cast<std::uint32_t>(shape_.positions.size());
  triangles_.clear();
  for (std::size_t t = 0; t < shape_.triangles.size(); ++t)
    if (is_parted_[t] == 0) triangles_.push_back(shape_.triangles[t]);
  const auto add = [&](const Parted& parted, std::uint32_t first, std::uint32_t count) {
    for (std::uint32_t i = first; i < first + count; ++i) {
      TriangleCorners corners = part_triangles_[i];
      for (std::uint32_t& v : corners)
        if (v >= fine) v += parted.first_vertex;
      triangles_.push_back(corners);
    }
  };
  for (const Parted& parted : parted_) add(parted, parted.first_face, parted.faces);
  skirts_ = 0;
  for (const Parted& parted : parted_) {
    add(parted, parted.first_face + parted.faces, parted.skirts);
    skirts_ += parted.skirts;
  }
}

void EmbeddedSurface::update(std::span<const Vec3f> positions) {
  moved_count_ = 0;
  if (rest_.empty() || positions.size() != rest_.size()) return;
  moved_.assign(positions.size(), is_stale_ || shown_.size() != positions.size());
  is_stale_ = false;
  if (shown_.size() == positions.size())
    for (const std::uint32_t face : faces_) {
      const auto& [a, b, c] = coarse_[face];
      if (positions[a] == shown_[a] && positions[b] == shown_[b] && positions[c] == shown_[c])
        continue;
      moved_[a] = moved_[b] = moved_[c] = 1;
    }
  shown_.assign(positions.begin(), positions.end());
  frames_.update(positions, coarse_, faces_);
  const auto& turns = frames_.turns();
  positions_.resize(vertices_.size());
  normals_.resize(vertices_.size());
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    const Vertex& v = vertices_[i];
    if (v.is_between()) {
      const auto& [a, b, ignored] = v.corner;
      positions_[i] = positions_[a] * v.weight[0] + positions_[b] * v.weight[1];
      normals_[i] = normalized(normals_[a] * v.weight[0] + normals_[b] * v.weight[1], v.normal);
      continue;
    }
    const std::uint32_t a = v.corner[0], b = v.corner[1], c = v.corner[2];
    if ((moved_[a] | moved_[b] | moved_[c]) == 0) continue;
    ++moved_count_;
    Turn turn;
    const auto mean = [&](Vec3f Turn::*column) {
      return turns[a].*column * v.weight[0] + turns[b].*column * v.weight[1] +
             turns[c].*column * v.weight[2];
    };
    turn.x = mean(&Turn::x), turn.y = mean(&Turn::y), turn.z = mean(&Turn::z);
    positions_[i] = positions[a] * v.weight[0] + positions[b] * v.weight[1] +
                    positions[c] * v.weight[2] + turn * v.offset;
    normals_[i] = normalized(turn * v.normal, v.normal);
  }
}

}  // namespace trocar::embedding
