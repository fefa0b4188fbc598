#include "tests/calibration/force_organs.h"

#include <algorithm>
#include <cmath>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/mesh/stuffing.h"
#include "server/organs/organ/average_strain.h"
#include "server/organs/organ/fix_rule.h"
#include "tests/support/random.h"
#include "tests/support/shared.h"

namespace trocar::calibration::testing {
namespace {

// About 1,500 nodes, so that a full solution of each tick is affordable.
constexpr int kTets = 6000;

void scale_stiffness(organ::Organ& organ, double by) {
  auto& material = organ.material;
  material.young_modulus_pa *= by;
  for (auto& c : material.measured.coefficients_pa) c *= by;
  material.measured.bulk_modulus_pa *= by;
}

void scale_size(organ::Organ& organ, double by) {
  for (auto& position : organ.mesh.rest_positions) position = position * by;
  for (auto& position : organ.stress_free_positions_m) position = position * by;
  organ.node_masses_kg = organ::lumped_masses(organ);
}

Result<organ::Organ> liver(bool is_measured, double size, double stiffness) {
  auto organ = is_measured ? catalogue::make_measured_liver(kTets) : catalogue::make_liver(kTets);
  if (!organ.ok()) return organ;
  scale_size(*organ, size);
  scale_stiffness(*organ, stiffness);
  if (auto averaged = organ::average_strain(*organ); !averaged.ok()) return averaged.error();
  return organ;
}

Result<organ::Organ> wall(const std::string& file, double stiffness) {
  auto imported =
      catalogue::import_organ(trocar::testing::shared_folder() / file, {.name = "wall"});
  if (!imported.ok()) return imported.error();
  imported->organ.material.elastic_law = material::ElasticLaw::NeoHookean;
  scale_stiffness(imported->organ, stiffness);
  return std::move(imported->organ);
}

Result<organ::Organ> made_of(const mesh::SignedField& field, const mesh::Box& box, double spacing,
                             double stiffness) {
  auto mesh = mesh::stuff_isosurface(field, box, spacing);
  if (!mesh.ok()) return mesh.error();
  organ::Organ organ;
  organ.name = "made";
  organ.source = "made for a test";
  organ.mesh = std::move(*mesh);
  organ.material.elastic_law = material::ElasticLaw::NeoHookean;
  scale_stiffness(organ, stiffness);
  organ.fixed_nodes = organ::nodes_held_by({}, organ.mesh);
  organ.node_masses_kg = organ::lumped_masses(organ);
  if (auto averaged = organ::average_strain(organ); !averaged.ok()) return averaged.error();
  return organ;
}

Result<organ::Organ> slab(std::uint64_t seed) {
  trocar::testing::Random random(seed);
  const double x = random.between(0.03, 0.08), y = random.between(0.01, 0.03),
               z = random.between(0.03, 0.08);
  const double stiffness = std::exp(random.between(-2, 2));
  const auto field = [=](const Vec3d& p) {
    return std::max({std::abs(p.x) - x, std::abs(p.y) - y, std::abs(p.z) - z});
  };
  const double margin = 0.01, spacing = std::cbrt(8 * x * y * z / 700);
  return made_of(field,
                 {{-x - margin, -y - margin, -z - margin}, {x + margin, y + margin, z + margin}},
                 spacing, stiffness);
}

Result<organ::Organ> shell(std::uint64_t seed) {
  trocar::testing::Random random(seed);
  const double radius = random.between(0.03, 0.07), wall = radius * random.between(0.2, 0.35);
  const double stiffness = std::exp(random.between(-2, 2));
  const auto field = [=](const Vec3d& p) {
    return std::abs(length(p) - radius + wall / 2) - wall / 2;
  };
  const double out = 1.2 * radius;
  return made_of(field, {{-out, -out, -out}, {out, out, out}}, wall / 1.7, stiffness);
}

}  // namespace

std::vector<ForceOrgan> force_organs() {
  std::vector<ForceOrgan> organs{{"liver", "", [] { return liver(true, 1, 1); }},
                                 {"elastic-liver", "", [] { return liver(false, 1, 1); }},
                                 {"liver / 2", "", [] { return liver(true, 0.5, 1); }},
                                 {"liver / 3", "", [] { return liver(true, 1.0 / 3, 1); }},
                                 {"soft liver / 2", "", [] { return liver(true, 0.5, 0.1); }},
                                 {"soft liver / 3", "", [] { return liver(true, 1.0 / 3, 0.1); }},
                                 {"stiff liver", "", [] { return liver(true, 1, 10); }},
                                 {"stiff liver / 2", "", [] { return liver(true, 0.5, 10); }},
                                 {"soft elastic / 2", "", [] { return liver(false, 0.5, 0.1); }},
                                 {"stiff elastic / 2", "", [] { return liver(false, 0.5, 10); }},
                                 {"gallbladder wall",
                                  "organs/gallbladder_wall.msh",
                                  [] { return wall("organs/gallbladder_wall.msh", 1); },
                                  {10, 40}},
                                 {"stomach wall", "organs/stomach_wall.msh",
                                  [] { return wall("organs/stomach_wall.msh", 1); }}};
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    organs.push_back({"slab " + std::to_string(seed), "", [seed] { return slab(seed); }});
    organs.push_back({"shell " + std::to_string(seed), "", [seed] { return shell(seed); }});
  }
  return organs;
}

}  // namespace trocar::calibration::testing
