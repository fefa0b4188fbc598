#include "tests/step/law_organs.h"

#include <cmath>

#include "tests/cutting/cut_organ.h"

namespace trocar::step::testing {
namespace {

template <typename Place>
void bend(organ::Organ& organ, const Place& place) {
  for (auto& p : organ.mesh.rest_positions) p = place(p);
  organ.mesh.build_adjacency();
  organ.node_masses_kg = organ::lumped_masses(organ);
}

template <typename IsFixed>
void fix(organ::Organ& organ, const IsFixed& is_fixed) {
  for (std::uint32_t n = 0; n < organ.mesh.node_count(); ++n)
    if (is_fixed(organ.mesh.rest_positions[n])) organ.fixed_nodes.emplace_back(n);
}

void drop_unused_nodes(mesh::TetMesh& mesh) {
  std::vector<std::uint8_t> is_used(mesh.node_count());
  for (const auto& tet : mesh.tets)
    for (const auto n : tet) is_used[n.value] = 1;
  std::vector<NodeIndex> number(mesh.node_count());
  std::vector<Vec3d> places;
  for (std::uint32_t n = 0; n < is_used.size(); ++n)
    if (is_used[n] != 0) {
      number[n] = NodeIndex(places.size());
      places.push_back(mesh.rest_positions[n]);
    }
  for (auto& tet : mesh.tets)
    for (auto& n : tet) n = number[n.value];
  mesh.rest_positions = std::move(places);
}

}  // namespace

organ::Organ law_organ(int kind, std::uint64_t seed) {
  using cutting::testing::box_organ;
  const auto is_low = [](const Vec3d& p) { return p.y < -0.0139; };
  organ::Organ organ;
  switch (kind) {
    case 0:  // two elements thick, on half of a cylinder
      organ = box_organ(16, 2, 10, 0.004, 0.2, seed);
      bend(organ, [](const Vec3d& p) {
        const double angle = p.x / 0.02, radius = 0.02 + p.y;
        return Vec3d{radius * std::sin(angle), radius * std::cos(angle) - 0.01, p.z};
      });
      fix(organ, is_low);
      break;
    case 1:  // bent, with a hole across
      organ = box_organ(12, 5, 5, 0.006, 0.2, seed);
      std::erase_if(organ.mesh.tets, [&](const mesh::Tet& tet) {
        Vec3d middle;
        for (const auto n : tet) middle += organ.mesh.rest_positions[n.value] * 0.25;
        return std::abs(middle.x) < 0.006 && std::abs(middle.z) < 0.006;
      });
      drop_unused_nodes(organ.mesh);
      bend(organ, [](const Vec3d& p) { return Vec3d{p.x, p.y - 6 * p.x * p.x + 0.002, p.z}; });
      fix(organ, is_low);
      break;
    case 2:
      organ = box_organ(6, 6, 6, 0.0025, 0.2, seed);
      organ.material.young_modulus_pa = 800;
      fix(organ, [](const Vec3d& p) { return p.y < -0.0074; });
      break;
    case 3:
      organ = box_organ(7, 5, 7, 0.006, 0.2, seed);
      organ.material.young_modulus_pa = 60'000;
      fix(organ, is_low);
      break;
    case 4:
      organ = box_organ(7, 5, 7, 0.006, 0.2, seed);
      break;
    default:
      organ = box_organ(7, 5, 7, 0.006, 0.2, seed);
      organ.material.tension = 0.05;
      organ.gravity_m_s2 = {0, -9.81, 0};
      fix(organ, is_low);
  }
  organ.material.elastic_law = material::ElasticLaw::NeoHookean;
  organ.material.has_averaged_strain = true;
  return organ;
}

const char* law_organ_name(int kind) {
  constexpr const char* kNames[kLawOrgans] = {"wall",  "bean", "soft and small",
                                              "stiff", "free", "under gravity and tension"};
  return kNames[kind];
}

}  // namespace trocar::step::testing
