#include "server/tissue/world/world.h"

#include <algorithm>

#include "common/base/assert.h"

namespace trocar::world {

World::World(const organ::Organ& organ)
    : surface_nodes(organ.mesh.surface_nodes),
      displacements(organ.mesh.node_count()),
      velocities(organ.mesh.node_count()),
      node_classes(organ.mesh.node_count(), NodeClass::Far),
      quiet_ticks(organ.mesh.node_count()),
      far_poses(organ.mesh.node_count()),
      relaxation(organ),
      still_ticks(1),
      calm_ticks(1),
      tie_extensions(organ::tie_count(organ.ties)) {
  const auto& mesh = organ.mesh;
  rest_positions.reserve(mesh.node_count());
  masses.reserve(mesh.node_count());
  for (const auto& p : mesh.rest_positions) rest_positions.push_back(to_float(p));
  for (const double m : organ.node_masses_kg) masses.push_back(static_cast<float>(m));
  std::vector<double> areas(mesh.node_count());
  for (const auto& [a, b, c] : mesh.boundary_triangles) {
    const auto& p = mesh.rest_positions;
    const double third = length(cross(p[b.value] - p[a.value], p[c.value] - p[a.value])) / 6.0;
    for (const auto node : {a, b, c}) areas[node.value] += third;
  }
  for (const double area : areas) surface_areas.push_back(static_cast<float>(area));
  for (const auto node : organ.fixed_nodes) node_classes[node.value] = NodeClass::Fixed;
}

void World::add_node(const Vec3d& rest_position, NodeIndex a, NodeIndex b, std::uint16_t t) {
  const auto between = [&](const std::vector<Vec3f>& values) {
    const Vec3f from = values[a.value], to = values[b.value];
    return from + (to - from) * (static_cast<float>(t) / 65536.0f);
  };
  origins.push_back({a, b, t});
  rest_positions.push_back(to_float(rest_position));
  masses.push_back(0);
  surface_areas.push_back(0);
  displacements.push_back(between(displacements));
  velocities.push_back(between(velocities));
  const bool is_fixed =
      node_classes[a.value] == NodeClass::Fixed && node_classes[b.value] == NodeClass::Fixed;
  node_classes.push_back(is_fixed ? NodeClass::Fixed : NodeClass::Active);
  quiet_ticks.push_back(0);
  far_poses.add_node(a, b, t);
  relaxation.add_node(a);
}

void World::move_node(const Vec3d& rest_position, NodeIndex node, NodeIndex toward,
                      std::uint16_t t) {
  const float share = static_cast<float>(t) / 65536.0f;
  for (auto* values : {&displacements, &velocities}) {
    Vec3f& own = (*values)[node.value];
    own += ((*values)[toward.value] - own) * share;
  }
  rest_positions[node.value] = to_float(rest_position);
}

void World::apply(const topology::Edit& edit) {
  const auto& topology = edit.topology;
  for (const auto& made : edit.new_nodes) {
    if (made.has_moved()) {
      move_node(topology.rest()[made.node.value], made.node, made.b, made.t);
      continue;
    }
    TROCAR_ASSERT(made.node.value == node_count());
    add_node(topology.rest()[made.node.value], made.a, made.b, made.t);
  }
  for (const auto& [part, parent] : topology.parts())
    relaxation.tets().inherit(part.value, parent.value);
  for (const auto node : topology.changed()) {
    masses[node.value] = static_cast<float>(topology.lumped_mass(node));
    auto& node_class = node_classes[node.value];
    if (node_class == NodeClass::Fixed) continue;
    node_class = NodeClass::Active;
    quiet_ticks[node.value] = 0;
  }
  const auto& surface = edit.surface;
  for (std::size_t i = 0; i < surface.touched.size(); ++i)
    surface_areas[surface.touched[i].value] = surface.areas_m2[i];
  const auto middle = static_cast<std::ptrdiff_t>(surface_nodes.size());
  surface_nodes.insert(surface_nodes.end(), surface.surfaced.begin(), surface.surfaced.end());
  std::inplace_merge(surface_nodes.begin(), surface_nodes.begin() + middle, surface_nodes.end());
}

void World::visit_state(StateArchive& archive) {
  archive.value(tick);
  archive.value(boundary);
  archive.fixed_array(displacements);
  archive.fixed_array(velocities);
  archive.fixed_array(node_classes);
  archive.fixed_array(quiet_ticks);
  far_poses.visit_state(archive);
  relaxation.visit_state(archive);
  archive.sized_array(still_ticks, static_cast<std::uint32_t>(node_count() + 1));
  archive.sized_array(calm_ticks, static_cast<std::uint32_t>(node_count() + 1));
  archive.fixed_array(tie_extensions);  // takes no bytes where there are no ties
  if (!archive.is_reading()) return;
  for (const float extension : tie_extensions)
    if (!(extension >= 0 && extension <= 1e9f)) archive.fail();
  if (boundary > Boundary::Whole) archive.fail();
  for (std::size_t i = 0; i < node_count(); ++i)
    if (node_classes[i] > NodeClass::Asleep || !is_finite(displacements[i]) ||
        !is_finite(velocities[i]))
      archive.fail();
}

}  // namespace trocar::world
