// The organ of a scenario: where it comes from, and what the scenario changes of it.

#include <algorithm>

#include "server/lab/scenario/scenario_block.h"
#include "server/lab/scenario/scenario_resolver.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/material/material_file.h"
#include "server/organs/material/material_keys.h"

namespace trocar::scenario {
namespace {

bool holds_an_element(const mesh::TetMesh& mesh, const NodeList& nodes) {
  std::vector<std::uint8_t> is_inside(mesh.node_count());
  for (const auto node : nodes) is_inside[node.value] = 1;
  const auto is_in = [&](const auto& element) {
    return std::ranges::all_of(element, [&](NodeIndex n) { return is_inside[n.value] != 0; });
  };
  return mesh.tets.empty() ? std::ranges::any_of(mesh.spring_pairs(), is_in)
                           : std::ranges::any_of(mesh.tets, is_in);
}

}  // namespace

Result<organ::Organ> Resolver::source_organ() const {
  const auto& rule = scenario_.organ;
  if (rule.source == "lattice" || rule.source == "block") {
    catalogue::LatticeSize size;
    if (rule.lattice_nodes)
      size = {(*rule.lattice_nodes)[0], (*rule.lattice_nodes)[1], (*rule.lattice_nodes)[2],
              size.spacing_m};
    size.spacing_m = rule.lattice_spacing_m.value_or(size.spacing_m);
    return rule.source == "block" ? make_block(size) : catalogue::make_lattice(size);
  }
  const std::filesystem::path path(rule.source);
  if (!path.has_extension() || path.is_absolute()) return catalogue::load_organ(rule.source);
  return catalogue::load_organ((scenario_.source.parent_path() / path).string());
}

Status Resolver::change_material(const MaterialChange& change, const organ::Organ& organ,
                                 material::Material& m) const {
  const auto set = [](const auto& from, auto& to) { to = from.value_or(to); };
  const bool has_tet_springs = !organ.mesh.tets.empty() && organ.mesh.links.empty();
  set(change.elastic_law, m.elastic_law);
  if (m.elastic_law != material::ElasticLaw::Springs && organ.mesh.tets.empty())
    return wrong(change.place_of("elastic_law"),
                 "this organ has no tets, write elastic_law = \"springs\" or take another organ");
  for (const auto& key : material::kLawKeys) {
    const Place& place = change.place_of(key.key);
    if (&place != &change.place && !applies(key, m.elastic_law))
      return wrong(place, std::string(key.why) + ", remove it");
  }
  if (change.measured) {
    const std::filesystem::path file(*change.measured);
    if (file.extension() == ".toml") {
      const auto measured = material::read_material_file(scenario_.source.parent_path() / file);
      if (!measured) return measured.error();
      material::use_measured(*measured, m);
    } else if (const auto* measured = material::find_measured_material(*change.measured)) {
      material::use_measured(*measured, m);
    } else {
      return wrong(
          change.place_of("measured"),
          "is none of " + material::measured_material_names() + ", nor the name of a .toml file");
    }
  } else if (m.elastic_law == material::ElasticLaw::Measured && m.measured.name.empty()) {
    return wrong(change.place_of("elastic_law"),
                 "needs a measured material, write measured = \"NAME\", one of " +
                     material::measured_material_names());
  }
  for (std::size_t i = 0; i < change.numbers.size(); ++i)
    set(change.numbers[i], m.*material::kNumberKeys[i].member);
  if (change.sets(&material::Material::young_modulus_pa)) {
    if (m.elastic_law == material::ElasticLaw::Springs && !has_tet_springs)
      return wrong(change.place_of("young_modulus_pa"),
                   "this organ's springs are no edges of tets, write spring_stiffness_n_m");
    m.spring_law = material::SpringLaw::VolumeConsistent;
  }
  if (change.sets(&material::Material::spring_stiffness_n_m))
    m.spring_law = material::SpringLaw::Constant;
  set(change.has_averaged_strain, m.has_averaged_strain);
  set(change.fibre_direction, m.fibre_direction);
  if (m.tear_stretch > 0 && m.tear_stretch < material::kLeastTearStretch)
    return wrong(change.place_of("tear_stretch"),
                 "is a length over a length at rest: write at least 1.05, or 0 for tissue that "
                 "never tears");
  for (const char* key : {"fibre_stiffness_ratio", "fibre_tension"}) {
    const Place& place = change.place_of(key);
    if (&place != &change.place && length(m.fibre_direction) == 0 && organ.fibre_directions.empty())
      return wrong(place, "needs a fibre_direction");
  }
  if (m.tension + m.fibre_tension > material::kMaxTension)
    return wrong(change.place_of(change.sets(&material::Material::fibre_tension) ? "fibre_tension"
                                                                                 : "tension"),
                 "shorten tissue by more than 0.9 of its length, write less");
  return {};
}

Status Resolver::change_materials(organ::Organ& organ) const {
  const auto before = organ::mass_weights(organ);
  const auto check = [&](const Place& place) -> Status {
    if (auto status = validate(organ); !status) return wrong(place, status.error().message);
    return {};
  };
  if (auto s = change_material(scenario_.material, organ, organ.material); !s) return s;
  if (auto s = check(scenario_.material.place); !s) return s;
  for (const auto& rule : scenario_.regions) {
    auto region = std::ranges::find(organ.regions, rule.name, &material::MaterialRegion::name);
    const bool is_new = region == organ.regions.end();
    if (is_new != rule.set.has_value())
      return wrong(is_new ? rule.material.place : rule.set->place,
                   is_new ? "the organ has no region \"" + rule.name + "\", add set = \"...\""
                          : "the organ has a region \"" + rule.name +
                                "\" already, give this one another name, or leave set out");
    if (is_new) {
      auto nodes = nodes_of(*rule.set, organ);
      if (!nodes) return nodes.error();
      if (!holds_an_element(organ.mesh, *nodes))
        return wrong(rule.set->place, "set \"" + rule.set->name + "\" holds no whole " +
                                          (organ.mesh.tets.empty() ? "spring" : "tet") +
                                          ", so nothing would have this material: enlarge it");
      organ.regions.push_back({rule.name, organ.material, std::move(*nodes)});
      region = organ.regions.end() - 1;
    }
    if (auto s = change_material(rule.material, organ, region->material); !s) return s;
    if (auto s = check(rule.material.place); !s) return s;
  }
  organ::follow_weights(organ, before);
  return {};
}

Result<organ::Organ> Resolver::make_organ() const {
  auto organ = source_organ();
  if (!organ) return wrong(scenario_.organ.place, organ.error().message);
  if (auto changed = change_materials(*organ); !changed) return changed.error();
  organ->gravity_m_s2 = scenario_.gravity_m_s2.value_or(organ->gravity_m_s2);
  if (!scenario_.keeps_organ_fixed) organ->fixed_nodes.clear();
  for (const auto& use : scenario_.fixes) {
    const auto nodes = nodes_of(use, *organ);
    if (!nodes) return nodes.error();
    organ->fixed_nodes.insert(organ->fixed_nodes.end(), nodes->begin(), nodes->end());
  }
  auto& fixed = organ->fixed_nodes;
  std::sort(fixed.begin(), fixed.end());
  fixed.erase(std::unique(fixed.begin(), fixed.end()), fixed.end());
  return organ;
}

}  // namespace trocar::scenario
