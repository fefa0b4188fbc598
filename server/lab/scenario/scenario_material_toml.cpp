// Materials and regions in a scenario's TOML form.

#include "server/lab/scenario/scenario_tables.h"

namespace trocar::scenario {
namespace {

void read_material_keys(tool::TableReader& reader, MaterialChange& material) {
  material.place = place_of(reader, "");
  material.given = places_of_keys(reader);
  material.density_kg_m3 = reader.number("density_kg_m3", 1, 30000);
  material.young_modulus_pa = reader.number("young_modulus_pa", 0, 1e12);
  material.spring_stiffness_n_m = reader.number("spring_stiffness_n_m", 0, 1e9);
  material.node_damping_per_s = reader.number("node_damping_per_s", 0, 1e6);
  material.spring_damping_time_s = reader.number("spring_damping_time_s", 0, 100);
  material.elastic_law = reader.choice<material::ElasticLaw, 4>(
      "elastic_law", {{{"springs", material::ElasticLaw::Springs},
                       {"tensor-mass", material::ElasticLaw::TensorMass},
                       {"neo-hookean", material::ElasticLaw::NeoHookean},
                       {"measured", material::ElasticLaw::Measured}}});
  material.measured = reader.string("measured");
  material.poisson_ratio = reader.number("poisson_ratio", 0, 0.4999);
  material.has_averaged_strain = reader.boolean("averaged_strain");
  if (const auto direction = reader.direction("fibre_direction"))
    material.fibre_direction = reader.vector("fibre_direction");
  material.fibre_stiffness_ratio = reader.number("fibre_stiffness_ratio", 0, 1000);
  material.tension = reader.number("tension", 0, 0.9);
  material.fibre_tension = reader.number("fibre_tension", 0, 0.9);
  material.cut_energy_j_m2 = reader.number("cut_energy_j_m2", 0, 1e6);
  material.blade_friction_pa = reader.number("blade_friction_pa", 0, 1e6);
  material.tear_stretch = reader.number("tear_stretch", 0, 100);
  if (material.young_modulus_pa && material.spring_stiffness_n_m)
    reader.fail("young_modulus_pa", "and spring_stiffness_n_m exclude each other, remove one");
}

}  // namespace

MaterialChange read_material(tool::TableReader& reader) {
  MaterialChange material;
  read_material_keys(reader, material);
  reader.finish();
  return material;
}

std::vector<RegionRule> read_regions(tool::Document& document, tool::TableReader& root) {
  std::vector<RegionRule> regions;
  const auto tables = limited_tables(root, "region");
  for (std::size_t i = 0; i < tables.size() && document.ok(); ++i) {
    tool::TableReader reader(document, *tables[i], table_entry("region", i));
    RegionRule region;
    region.set = read_set(reader);
    region.name = reader.string("name").value_or(region.set ? region.set->name : "");
    if (region.name.empty())
      reader.fail("set", "is missing, name the set of [[nodes]] that this material fills");
    for (const auto& other : regions)
      if (other.name == region.name)
        reader.fail(reader.has("name") ? "name" : "set",
                    "\"" + region.name + "\" is the region in line " +
                        std::to_string(other.material.place.line) +
                        " already, give this one a name of its own");
    read_material_keys(reader, region.material);
    std::erase_if(region.material.given, [](const Place& place) {
      return place.key.ends_with(".name") || place.key.ends_with(".set");
    });
    if (region.material.given.empty()) reader.fail("", "changes nothing, add a key of [material]");
    reader.finish();
    regions.push_back(std::move(region));
  }
  return regions;
}

}  // namespace trocar::scenario
