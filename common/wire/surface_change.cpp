#include "common/wire/surface_change.h"

#include <algorithm>
#include <string>

#include "common/base/mix.h"
#include "common/wire/surface_layout.h"

namespace trocar::wire {
namespace {

Error bad(const std::string& what) {
  return {ErrorCode::BadMessage, "SurfaceChange: " + what};
}

bool is_in_reach(const QuantisedVertex& v) {
  const auto inside = [](std::int32_t c) { return c >= -kMaxRestQuanta && c <= kMaxRestQuanta; };
  return inside(v.x) && inside(v.y) && inside(v.z);
}

Status check_vertices(const SurfaceChange& change, const SurfaceLayout& layout) {
  const std::size_t first = layout.vertex_count();
  if (change.new_vertices.size() > kMaxSurfaceVertices - std::min(first, kMaxSurfaceVertices))
    return bad("more than 4,000,000 vertices");
  std::vector<NodeIndex> nodes;
  for (std::size_t i = 0; i < change.new_vertices.size(); ++i) {
    const NewVertex& v = change.new_vertices[i];
    if (!is_in_reach(v.rest_quanta)) return bad("a vertex is more than 2 m from the origin");
    if (v.a.is_valid() != v.b.is_valid() ||
        (v.a.is_valid() && std::max(v.a, v.b).value >= first + i))
      return bad("a vertex comes before the one it was made from");
    if (!v.node.is_valid()) continue;
    if (v.node.value < layout.vertex_of_node.size() &&
        layout.vertex_of_node[v.node.value].is_valid())
      return bad("node " + std::to_string(v.node.value) + " has a vertex already");
    nodes.push_back(v.node);
  }
  std::sort(nodes.begin(), nodes.end());
  if (std::adjacent_find(nodes.begin(), nodes.end()) != nodes.end())
    return bad("two vertices of one node");
  return {};
}

Status check_triangles(const SurfaceChange& change, const SurfaceLayout& layout) {
  const std::size_t count = layout.triangles.size();
  if (change.added.size() > kMaxSurfaceTriangles - std::min(count, kMaxSurfaceTriangles))
    return bad("more than 8,000,000 triangles");
  for (std::size_t i = 0; i < change.removed.size(); ++i) {
    const TriangleIndex number = change.removed[i];
    if (number.value >= count) return bad("removed triangle out of range");
    if (i > 0 && number <= change.removed[i - 1]) return bad("removed triangles do not ascend");
    if (!layout.has_triangle(number)) return bad("a removed triangle is gone already");
  }
  const std::size_t vertices = layout.vertex_count() + change.new_vertices.size();
  for (const NewTriangle& triangle : change.added) {
    if (triangle.is_gap()) continue;
    const auto& [a, b, c] = triangle.corners;
    if (std::max({a, b, c}).value >= vertices)
      return bad("corner of an added triangle out of range");
    if (a == b || b == c || c == a) return bad("an added triangle has a corner twice");
  }
  return {};
}

}  // namespace

std::uint64_t triangle_hash(TriangleIndex number, const Corners& corners, bool is_wound) {
  const std::uint64_t first = number.value | std::uint64_t{corners[0].value} << 32;
  const std::uint64_t rest = corners[1].value | std::uint64_t{corners[2].value} << 32;
  const std::uint64_t hash = mix_bits(mix_bits(first) ^ rest);
  return is_wound ? ~hash : hash;
}

std::uint64_t sum_after(const SurfaceChange& change, const SurfaceLayout& layout) {
  std::uint64_t sum = layout.triangle_sum;
  for (const TriangleIndex number : change.removed)
    sum -=
        triangle_hash(number, layout.triangles[number.value], layout.is_wound[number.value] != 0);
  for (std::size_t i = 0; i < change.added.size(); ++i)
    if (!change.added[i].is_gap())
      sum += triangle_hash(TriangleIndex(layout.triangles.size() + i), change.added[i].corners,
                           change.added[i].is_wound);
  return sum;
}

Status apply(const SurfaceChange& change, SurfaceLayout& layout) {
  if (change.from_epoch != layout.epoch || change.epoch <= change.from_epoch)
    return bad("leads from epoch " + std::to_string(change.from_epoch) + " to " +
               std::to_string(change.epoch) + ", the surface has " + std::to_string(layout.epoch));
  if (Status checked = check_vertices(change, layout); !checked.ok()) return checked;
  if (Status checked = check_triangles(change, layout); !checked.ok()) return checked;
  if (sum_after(change, layout) != change.sum)
    return bad("sum of triangles differs after epoch " + std::to_string(change.epoch));

  for (const NewVertex& vertex : change.new_vertices) {
    const VertexIndex slot(layout.vertex_count());
    layout.rest_quanta.push_back(vertex.rest_quanta);
    layout.node_of_vertex.push_back(vertex.node);
    if (vertex.is_fixed) layout.fixed_vertices.push_back(slot);
    if (!vertex.node.is_valid()) continue;
    if (vertex.node.value >= layout.vertex_of_node.size())
      layout.vertex_of_node.resize(std::size_t{vertex.node.value} + 1);
    layout.vertex_of_node[vertex.node.value] = slot;
  }
  for (const TriangleIndex number : change.removed) {
    layout.triangles[number.value] = {};
    layout.is_wound[number.value] = 0;
  }
  for (const NewTriangle& triangle : change.added) {
    layout.triangles.push_back(triangle.corners);
    layout.is_wound.push_back(triangle.is_wound);
  }
  layout.epoch = change.epoch;
  layout.triangle_sum = change.sum;
  return {};
}

QuantisedVertex between(const QuantisedVertex& a, const QuantisedVertex& b, std::uint16_t t) {
  const auto along = [t](std::int32_t from, std::int32_t to) {
    // Shifts of negative numbers round down (C++20): with the half, to the nearest.
    const std::int64_t way = (std::int64_t{to} - from) * t;
    return static_cast<std::int32_t>(from + ((way + 0x8000) >> 16));
  };
  return {along(a.x, b.x), along(a.y, b.y), along(a.z, b.z)};
}

}  // namespace trocar::wire
