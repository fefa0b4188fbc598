#include "server/organs/catalogue/hidden_structures.h"

#include <algorithm>
#include <ranges>

namespace trocar::catalogue {
namespace {

using material::MaterialRegion;

MaterialRegion region_of(const lesson::Structure& structure, const organ::Organ& organ) {
  MaterialRegion region{.name = structure.name, .material = organ.material, .nodes = {}};
  region.material.elastic_law = material::ElasticLaw::NeoHookean;
  region.material.young_modulus_pa = structure.young_modulus_pa;
  region.material.poisson_ratio = structure.poisson_ratio;
  const auto& places = organ.mesh.rest_positions;
  for (std::uint32_t n = 0; n < places.size(); ++n)
    if (structure.distance_m(places[n]) <= 0) region.nodes.emplace_back(n);
  return region;
}

bool has_a_tet(const MaterialRegion& region, const organ::Organ& organ) {
  return std::ranges::any_of(organ.mesh.tets, [&](const auto& tet) {
    return std::ranges::all_of(
        tet, [&](NodeIndex node) { return std::ranges::binary_search(region.nodes, node); });
  });
}

}  // namespace

Status add_structures(const lesson::Lesson& lesson, organ::Organ& organ) {
  if (!lesson.structures.empty() && !material::is_hyperelastic(organ.material))
    return Error{ErrorCode::Usage, "lesson \"" + lesson.title + "\": the organ " + organ.name +
                                       " is not of hyperelastic tets, and can hide nothing"};
  for (const auto& structure : lesson.structures) {
    auto region = region_of(structure, organ);
    if (!has_a_tet(region, organ))
      return Error{ErrorCode::Usage, "lesson \"" + lesson.title + "\": structure \"" +
                                         structure.name + "\": no element of the organ " +
                                         organ.name + " lies within it, move it or make it larger"};
    organ.regions.push_back(std::move(region));
  }
  return {};
}

}  // namespace trocar::catalogue
