#include "server/tissue/bleeding/surface_graph.h"

#include <algorithm>

namespace trocar::bleeding {
void SurfaceGraph::add(std::uint32_t triangle) {
  for (std::uint32_t corner = 0; corner < 3; ++corner) {
    const auto vertex = triangles_[triangle][corner].value;
    const auto at = 3 * triangle + corner;
    next_[at] = first_[vertex];
    first_[vertex] = at;
    note(vertex);
  }
}

void SurfaceGraph::remove(std::uint32_t triangle) {
  for (std::uint32_t corner = 0; corner < 3; ++corner) {
    const auto vertex = triangles_[triangle][corner].value;
    const auto at = 3 * triangle + corner;
    auto* link = &first_[vertex];
    while (*link != at) link = &next_[*link];
    *link = next_[at];
    note(vertex);
  }
  triangles_[triangle] = {};
}

void SurfaceGraph::note(std::uint32_t vertex) {
  if (is_changed_[vertex] != 0) return;
  is_changed_[vertex] = 1;
  changed_.push_back(vertex);
}

void SurfaceGraph::measure_changed(const wire::SurfaceLayout& layout) {
  std::ranges::sort(changed_);
  for (const auto vertex : changed_) {
    is_changed_[vertex] = 0;
    double area = 0, wound = 0;
    const Vec3d here = layout.rest_m(VertexIndex(vertex));
    for (std::uint32_t at = first_[vertex]; at != kNone; at = next_[at]) {
      const auto& corners = triangles_[at / 3];
      const Vec3d a = layout.rest_m(corners[(at + 1) % 3]) - here;
      const Vec3d b = layout.rest_m(corners[(at + 2) % 3]) - here;
      const double share = length(cross(a, b)) / 6;
      area += share;
      if (layout.is_wound[at / 3] != 0) wound += share;
    }
    area_m2_[vertex] = area;
    wound_m2_[vertex] = wound;
  }
}

void SurfaceGraph::rebuild(const wire::SurfaceLayout& layout) {
  const auto vertices = layout.vertex_count();
  triangles_.assign(layout.triangles.begin(), layout.triangles.end());
  first_.assign(vertices, kNone);
  next_.assign(3 * triangles_.size(), kNone);
  area_m2_.assign(vertices, 0);
  wound_m2_.assign(vertices, 0);
  is_changed_.assign(vertices, 0);
  changed_.clear();
  for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) note(vertex);
  for (std::uint32_t triangle = 0; triangle < triangles_.size(); ++triangle)
    if (layout.has_triangle(TriangleIndex(triangle))) add(triangle);
  measure_changed(layout);
}

void SurfaceGraph::apply(const wire::SurfaceChange& change, const wire::SurfaceLayout& layout) {
  changed_.clear();
  const auto vertices = layout.vertex_count();
  first_.resize(vertices, kNone);
  area_m2_.resize(vertices, 0);
  wound_m2_.resize(vertices, 0);
  is_changed_.resize(vertices, 0);
  for (const auto triangle : change.removed) remove(triangle.value);
  auto next = static_cast<std::uint32_t>(triangles_.size());
  triangles_.resize(layout.triangles.size());
  next_.resize(3 * triangles_.size(), kNone);
  for (const auto& added : change.added) {
    triangles_[next] = added.corners;
    if (!added.is_gap()) add(next);
    ++next;
  }
  measure_changed(layout);
}

}  // namespace trocar::bleeding
