#include "client/editor/organ_view.h"

#include <algorithm>

#include "client/device/ray_pick.h"
#include "server/organs/organ/organ_figures.h"

namespace trocar::editor {

OrganView::OrganView(const organ::Organ& organ) : mesh_(organ.mesh) {
  if (!organ.fine_surface.empty())
    fine_ = std::make_shared<const wire::FineSurface>(organ.fine_surface);
  const auto& mesh = organ.mesh;
  std::vector<std::uint32_t> vertex_of(mesh.node_count());
  for (const NodeIndex node : mesh.surface_nodes) {
    vertex_of[node.value] = static_cast<std::uint32_t>(rest_.size());
    rest_.push_back(to_float(mesh.rest_positions[node.value]));
  }
  for (const auto& [a, b, c] : mesh.boundary_triangles)
    triangles_.push_back({vertex_of[a.value], vertex_of[b.value], vertex_of[c.value]});
  positions_ = rest_;
  parts_.assign(rest_.size(), 0);
  is_held_.assign(rest_.size(), 0);
  radius_m_ = static_cast<float>(length(organ::size_of(mesh)) / 2);
}

void OrganView::colour(const organ::Organ& organ) {
  const auto map = organ::material_map(organ);
  for (std::size_t v = 0; v < rest_.size(); ++v) {
    const NodeIndex node = mesh_.surface_nodes[v];
    is_held_[v] = std::ranges::binary_search(organ.fixed_nodes, node) ? 1 : 0;
    parts_[v] = map.nodes[node.value];
  }
}

std::vector<render::Hold> OrganView::colours(bool shows_held, bool shows_regions) const {
  std::vector<render::Hold> colours(rest_.size());
  for (std::size_t v = 0; v < rest_.size(); ++v) {
    if (shows_held && is_held_[v] != 0)
      colours[v] = {kHeldColour, true};
    else if (shows_regions && parts_[v] != 0)
      colours[v] = {colour_of_part(parts_[v] - 1u), true};
  }
  return colours;
}

void OrganView::move(std::span<const Vec3f> displacements) {
  for (std::size_t v = 0; v < rest_.size(); ++v) {
    const auto node = mesh_.surface_nodes[v].value;
    positions_[v] = node < displacements.size() ? rest_[v] + displacements[node] : rest_[v];
  }
}

std::optional<edit::SurfacePlace> OrganView::place_at(const device::ViewRays& view, float x,
                                                      float y) const {
  const auto picked = device::pick_place(positions_, triangles_, view.eye, view.ray_through(x, y));
  if (!picked) return std::nullopt;
  const auto& corners = mesh_.boundary_triangles[picked->triangle];
  const auto [b, c] = picked->weight;
  const auto corner = [&](std::size_t i) { return mesh_.rest_positions[corners[i].value]; };
  return edit::SurfacePlace{picked->triangle, corner(0) * static_cast<double>(1 - b - c) +
                                                  corner(1) * static_cast<double>(b) +
                                                  corner(2) * static_cast<double>(c)};
}

Vec3d OrganView::normal_at(const edit::SurfacePlace& place) const {
  const auto& [a, b, c] = mesh_.boundary_triangles[place.triangle];
  const auto& p = mesh_.rest_positions;
  return normalized(cross(p[b.value] - p[a.value], p[c.value] - p[a.value]), Vec3d{0, 1, 0});
}

render::SceneView OrganView::scene(bool shows_held, bool shows_regions, bool shows_fine) const {
  render::SceneView scene;
  scene.topology_version = 1;
  scene.rest_positions = rest_;
  scene.triangles = triangles_;
  if (shows_fine) scene.fine_surface = fine_;
  scene.positions = positions_;
  scene.holds = colours(shows_held, shows_regions);
  return scene;
}

}  // namespace trocar::editor
