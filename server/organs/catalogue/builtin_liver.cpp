#include <string>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/builtin_search.h"
#include "server/organs/catalogue/liver_shape.h"
#include "server/organs/material/hyperelastic_material.h"
#include "server/organs/mesh/stuffing.h"

namespace trocar::catalogue {

Result<organ::Organ> make_liver(int target_tets) {
  if (target_tets < kMinLiverTets || target_tets > kMaxLiverTets)
    return Error{ErrorCode::Usage, "liver: " + std::to_string(target_tets) + " tets, must be " +
                                       std::to_string(kMinLiverTets) + " to " +
                                       std::to_string(kMaxLiverTets)};
  const auto mesh_at = [](double spacing_m) {
    return mesh::stuff_isosurface(liver_field, liver_box(), spacing_m);
  };
  auto mesh = mesh_with_about(target_tets, 1.63e-3, mesh_at, "liver");
  if (!mesh) return mesh.error();
  organ::Organ organ;
  organ.name = "liver";
  organ.source = "liver, " + std::to_string(target_tets) + " tets asked for";
  organ.mesh = std::move(*mesh);
  organ.material.elastic_law = material::ElasticLaw::NeoHookean;
  for (const NodeIndex node : organ.mesh.surface_nodes)
    if (is_liver_held(organ.mesh.rest_positions[node.value])) organ.fixed_nodes.push_back(node);
  organ.source_offset_m = mesh::centre_on_origin(organ.mesh);
  organ.node_masses_kg = organ::lumped_masses(organ);
  if (auto status = validate(organ); !status) return status.error();
  return organ;
}

Result<organ::Organ> make_measured_liver(int target_tets) {
  auto organ = make_liver(target_tets);
  if (!organ) return organ;
  material::use_measured(*material::find_measured_material("human_liver_nava2008"),
                         organ->material);
  organ->material.has_averaged_strain = true;
  return organ;
}

}  // namespace trocar::catalogue
