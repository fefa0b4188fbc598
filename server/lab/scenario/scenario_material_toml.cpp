// Materials and regions in a scenario's TOML form.

#include "server/lab/scenario/scenario_tables.h"

namespace trocar::scenario {
namespace {

void read_material_keys(tool::TableReader& reader, MaterialChange& material) {
  material.place = place_of(reader, "");
  material.given = places_of_keys(reader);
  for (std::size_t i = 0; i < material.numbers.size(); ++i) {
    const auto& key = material::kNumberKeys[i];
    material.numbers[i] = reader.number(key.key, key.low, key.high);
  }
  material.elastic_law = reader.choice<material::ElasticLaw, 4>(
      "elastic_law", {{{"springs", material::ElasticLaw::Springs},
                       {"tensor-mass", material::ElasticLaw::TensorMass},
                       {"neo-hookean", material::ElasticLaw::NeoHookean},
                       {"measured", material::ElasticLaw::Measured}}});
  material.measured = reader.string("measured");
  material.has_averaged_strain = reader.boolean("averaged_strain");
  if (const auto direction = reader.direction("fibre_direction"))
    material.fibre_direction = reader.vector("fibre_direction");
  if (material.sets(&material::Material::young_modulus_pa) &&
      material.sets(&material::Material::spring_stiffness_n_m))
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
