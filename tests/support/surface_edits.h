#pragma once

// Changes of a surface as a blade makes them: split edges, slits with an inner wall. A closed
// surface stays closed, which every test may check.

#include <algorithm>
#include <deque>
#include <map>
#include <set>
#include <vector>

#include "common/wire/surface_change.h"
#include "common/wire/surface_layout.h"
#include "tests/support/random.h"

namespace trocar::testing {

using DirectedEdges = std::map<std::pair<VertexIndex, VertexIndex>, TriangleIndex>;

inline DirectedEdges directed_edges(const wire::SurfaceLayout& layout) {
  DirectedEdges edges;
  for (std::size_t i = 0; i < layout.triangles.size(); ++i)
    for (std::size_t k = 0; k < 3 && layout.has_triangle(TriangleIndex(i)); ++k)
      edges[{layout.triangles[i][k], layout.triangles[i][(k + 1) % 3]}] = TriangleIndex(i);
  return edges;
}

// Every edge of every triangle has one neighbour that runs it the other way.
inline bool is_closed(const wire::SurfaceLayout& layout) {
  const DirectedEdges edges = directed_edges(layout);
  std::size_t live = 0;
  for (std::size_t i = 0; i < layout.triangles.size(); ++i)
    live += layout.has_triangle(TriangleIndex(i));
  return edges.size() == 3 * live && std::ranges::all_of(edges, [&](const auto& edge) {
           return edges.contains({edge.first.second, edge.first.first});
         });
}

class SurfaceEdit {
 public:
  explicit SurfaceEdit(const wire::SurfaceLayout& layout) : layout_(layout) {
    change_.from_epoch = layout.epoch;
    change_.epoch = layout.epoch + 1;
  }
  // On a - b; a == b: a copy.
  VertexIndex add_on(VertexIndex a, VertexIndex b, std::uint16_t t) {
    const auto& rest = layout_.rest_quanta;
    return add({wire::between(rest[a.value], rest[b.value], t), {}, a, b, t, false});
  }
  VertexIndex add_inside(const wire::QuantisedVertex& rest) {
    return add({rest, {}, {}, {}, 0, false});
  }
  void remove(TriangleIndex number) { change_.removed.push_back(number); }
  void add(const wire::Corners& corners, bool is_wound) {
    change_.added.push_back({corners, is_wound});
  }
  wire::SurfaceChange finish() {
    std::ranges::sort(change_.removed);
    change_.sum = wire::sum_after(change_, layout_);
    return change_;
  }

 private:
  VertexIndex add(wire::NewVertex vertex) {
    if (!layout_.vertex_of_node.empty())
      vertex.node = NodeIndex(layout_.vertex_of_node.size() + change_.new_vertices.size());
    change_.new_vertices.push_back(vertex);
    return VertexIndex(layout_.vertex_count() + change_.new_vertices.size() - 1);
  }

  const wire::SurfaceLayout& layout_;
  wire::SurfaceChange change_;
};

// a - b is an edge.
inline wire::SurfaceChange split_edge(const wire::SurfaceLayout& layout, VertexIndex a,
                                      VertexIndex b, std::uint16_t t) {
  SurfaceEdit edit(layout);
  const VertexIndex middle = edit.add_on(a, b, t);
  const DirectedEdges edges = directed_edges(layout);
  for (const auto& ends : {std::pair{a, b}, std::pair{b, a}}) {
    const TriangleIndex number = edges.at(ends);
    edit.remove(number);
    for (const VertexIndex out : {a, b}) {
      wire::Corners half = layout.triangles[number.value];
      std::ranges::replace(half, out, middle);
      edit.add(half, layout.is_wound[number.value] != 0);
    }
  }
  return edit.finish();
}

// Opens the surface along a path of edges: the inner vertices of the path are doubled, and a wall
// goes down on either side to a common bottom at `depth`.
inline wire::SurfaceChange open_slit(const wire::SurfaceLayout& layout,
                                     const std::vector<VertexIndex>& path,
                                     const wire::QuantisedVertex& depth) {
  SurfaceEdit edit(layout);
  const DirectedEdges edges = directed_edges(layout);
  std::vector<VertexIndex> other = path, bottom = path;
  std::map<TriangleIndex, wire::Corners> right;
  for (std::size_t i = 1; i + 1 < path.size(); ++i) {
    other[i] = edit.add_on(path[i], path[i], 0);
    bottom[i] = edit.add_inside(layout.rest_quanta[path[i].value] + depth);
    for (VertexIndex x = path[i - 1]; x != path[i + 1];) {
      const TriangleIndex number = edges.at({path[i], x});
      const wire::Corners& corners = layout.triangles[number.value];
      const auto at = std::ranges::find(corners, path[i]) - corners.begin();
      x = corners[static_cast<std::size_t>(at + 2) % 3];
      std::ranges::replace(right.try_emplace(number, corners).first->second, path[i], other[i]);
    }
  }
  for (const auto& [number, corners] : right) {
    edit.remove(number);
    edit.add(corners, layout.is_wound[number.value] != 0);
  }
  const auto add_wall = [&](const wire::Corners& corners) {
    const auto& [a, b, c] = corners;
    if (a != b && b != c && c != a) edit.add(corners, true);
  };
  for (std::size_t i = 0; i + 1 < path.size(); ++i) {
    add_wall({path[i + 1], path[i], bottom[i]});
    add_wall({path[i + 1], bottom[i], bottom[i + 1]});
    add_wall({other[i], other[i + 1], bottom[i + 1]});
    add_wall({other[i], bottom[i + 1], bottom[i]});
  }
  return edit.finish();
}

// Over the fewest edges; empty if they are not connected.
inline std::vector<VertexIndex> path_between(const wire::SurfaceLayout& layout, VertexIndex from,
                                             VertexIndex to) {
  std::map<VertexIndex, std::vector<VertexIndex>> neighbours;
  for (const auto& [ends, triangle] : directed_edges(layout))
    neighbours[ends.first].push_back(ends.second);
  std::map<VertexIndex, VertexIndex> came_from{{to, to}};
  for (std::deque<VertexIndex> queue{to}; !queue.empty(); queue.pop_front())
    for (const VertexIndex next : neighbours[queue.front()])
      if (came_from.try_emplace(next, queue.front()).second) queue.push_back(next);
  std::vector<VertexIndex> path;
  if (!came_from.contains(from)) return path;
  for (VertexIndex v = from; path.empty() || path.back() != to; v = came_from.at(v))
    path.push_back(v);
  return path;
}

// Returns the change of a split edge or a slit at a random place of the surface.
inline wire::SurfaceChange random_change(const wire::SurfaceLayout& layout, Random& random) {
  const DirectedEdges edges = directed_edges(layout);
  const auto edge =
      std::next(edges.begin(), random.below(static_cast<std::uint32_t>(edges.size())));
  const auto [a, b] = edge->first;
  if (random.below(2) == 0)
    return split_edge(layout, a, b, static_cast<std::uint16_t>(random.below(65536)));
  // Onwards from a - b to whichever vertex comes next, never back.
  std::vector<VertexIndex> path{a, b};
  const std::size_t length = 3 + random.below(6);
  while (path.size() < length) {
    const auto begin = edges.lower_bound({path.back(), VertexIndex(0)});
    std::vector<VertexIndex> onward;
    for (auto it = begin; it != edges.end() && it->first.first == path.back(); ++it)
      if (std::ranges::find(path, it->first.second) == path.end())
        onward.push_back(it->first.second);
    if (onward.empty()) break;
    path.push_back(onward[random.below(static_cast<std::uint32_t>(onward.size()))]);
  }
  if (path.size() < 3) return split_edge(layout, a, b, 0x8000);
  return open_slit(layout, path, {0, -300 - static_cast<std::int32_t>(random.below(300)), 40});
}

}  // namespace trocar::testing
