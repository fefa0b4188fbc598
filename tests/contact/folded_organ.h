#pragma once

// Organs for contact of tissue with tissue: two flaps across a gap, alone or joined at one end.

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "common/base/assert.h"
#include "server/lab/scenario/scenario_block.h"
#include "server/organs/organ/organ.h"
#include "server/tissue/world/world.h"

namespace trocar::contact::testing {

// y is up; flaps of `thickness` cells with `gap` cells between them, `length` x `width` cells.
struct Flaps {
  int length = 8, width = 6, thickness = 2, gap = 2;
  int hinge = 2;  // cells at the low end of x that join them; 0: two bodies
  double spacing_m = 0.0035;
  double damping_per_s = 0;
  // The upper flap is moved by this at rest, so that nodes do not face nodes.
  double offset_m = 0;

  double half_height_m() const { return (thickness + gap / 2.0) * spacing_m; }
  double half_gap_m() const { return gap / 2.0 * spacing_m; }
};

inline organ::Organ make_flaps(const Flaps& f) {
  const catalogue::LatticeSize size{f.length + 1, 2 * f.thickness + f.gap + 1, f.width + 1,
                                    f.spacing_m};
  auto organ = scenario::make_block(size);
  TROCAR_ASSERT(organ.ok());
  const auto in_gap = [&](int i, int j) {
    return i >= f.hinge && j >= f.thickness && j < f.thickness + f.gap;
  };
  // Tets of a cube lie between its corners: where their middle is tells the cube.
  const auto all = organ->mesh;
  mesh::TetMesh kept;
  std::vector<NodeIndex> new_index(all.node_count());
  for (const auto& tet : all.tets) {
    Vec3d middle;
    for (const auto node : tet) middle += all.rest_positions[node.value] / 4.0;
    const auto cell = [&](double c, int count) {
      return static_cast<int>(std::floor(c / f.spacing_m + count / 2.0));
    };
    if (in_gap(cell(middle.x, f.length), cell(middle.y, size.ny - 1))) continue;
    mesh::Tet moved = tet;
    for (auto& node : moved) {
      if (!new_index[node.value].is_valid()) {
        new_index[node.value] = NodeIndex(kept.rest_positions.size());
        Vec3d p = all.rest_positions[node.value];
        if (f.hinge == 0 && p.y > 0) p += Vec3d{f.offset_m, 0, 0.7 * f.offset_m};
        kept.rest_positions.push_back(p);
      }
      node = new_index[node.value];
    }
    kept.tets.push_back(moved);
  }
  kept.build_adjacency();
  organ->mesh = std::move(kept);
  organ->material.elastic_law = material::ElasticLaw::NeoHookean;
  organ->material.young_modulus_pa = 4000;
  organ->material.poisson_ratio = 0.4;
  organ->material.node_damping_per_s = f.damping_per_s;
  organ->fixed_nodes.clear();
  organ->gravity_m_s2 = {};
  organ->node_masses_kg = organ::lumped_masses(*organ);
  return *organ;
}

inline double distance_to_triangle(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const Vec3d n = cross(b - a, c - a);
  const bool is_above = dot(cross(b - a, p - a), n) >= 0 && dot(cross(c - b, p - b), n) >= 0 &&
                        dot(cross(a - c, p - c), n) >= 0;
  if (is_above) return std::abs(dot(p - a, n)) / length(n);
  double nearest = 1e9;
  const auto edge = [&](const Vec3d& from, const Vec3d& to) {
    const Vec3d way = to - from;
    const double part = std::clamp(dot(p - from, way) / dot(way, way), 0.0, 1.0);
    nearest = std::min(nearest, length(p - from - way * part));
  };
  edge(a, b), edge(b, c), edge(c, a);
  return nearest;
}

// How far a node of the surface is inside a tet that is not its own or a neighbour's: the deepest.
// Brute force over everything.
inline double deepest_inside(const organ::Organ& organ, const world::World& world) {
  const auto& mesh = organ.mesh;
  const auto at = [&](NodeIndex node) {
    return mesh.rest_positions[node.value] + to_double(world.displacements[node.value]);
  };
  double deepest = 0;
  for (const auto node : mesh.surface_nodes) {
    const Vec3d p = at(node);
    bool is_inside = false;
    for (const auto& tet : mesh.tets) {
      if (std::ranges::find(tet, node) != tet.end()) continue;
      const Vec3d a = at(tet[0]), ab = at(tet[1]) - a, ac = at(tet[2]) - a, ad = at(tet[3]) - a;
      const double volume = dot(cross(ab, ac), ad);
      if (!(volume > 0)) continue;
      const Vec3d ap = p - a;
      const double v = dot(cross(ap, ac), ad) / volume, w = dot(cross(ab, ap), ad) / volume,
                   x = dot(cross(ab, ac), ap) / volume;
      if (v >= 0 && w >= 0 && x >= 0 && v + w + x <= 1) {
        is_inside = true;
        break;
      }
    }
    if (!is_inside) continue;
    double nearest = 1e9;
    for (const auto& t : mesh.boundary_triangles) {
      if (std::ranges::find(t, node) != t.end()) continue;
      nearest = std::min(nearest, distance_to_triangle(p, at(t[0]), at(t[1]), at(t[2])));
    }
    deepest = std::max(deepest, nearest);
  }
  return deepest;
}

}  // namespace trocar::contact::testing
