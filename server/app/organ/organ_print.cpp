#include "server/app/organ/organ_print.h"

#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstdio>

#include "common/base/json.h"
#include "server/organs/material/material_keys.h"
#include "server/organs/organ/organ_figures.h"

namespace trocar::app {
namespace {

struct EdgeLengths {
  double min_mm = 0, mean_mm = 0, max_mm = 0;
};

// Lengths of the springs' edges.
EdgeLengths edge_lengths(const mesh::TetMesh& mesh) {
  EdgeLengths lengths;
  const auto& pairs = mesh.spring_pairs();
  if (pairs.empty()) return lengths;
  lengths.min_mm = 1e9;
  for (const auto& [a, b] : pairs) {
    const double l = 1e3 * length(mesh.rest_positions[b.value] - mesh.rest_positions[a.value]);
    lengths.min_mm = std::min(lengths.min_mm, l);
    lengths.max_mm = std::max(lengths.max_mm, l);
    lengths.mean_mm += l / static_cast<double>(pairs.size());
  }
  return lengths;
}

std::size_t nodes_with_fibres(const organ::Organ& organ) {
  return static_cast<std::size_t>(
      std::ranges::count_if(organ.fibre_directions, [](const Vec3d& f) { return f != Vec3d{}; }));
}

void print_fibres(const material::Material& m) {
  if (length(m.fibre_direction) > 0)
    std::printf("  fibres              along %.3g %.3g %.3g\n", m.fibre_direction.x,
                m.fibre_direction.y, m.fibre_direction.z);
  if (m.fibre_stiffness_ratio != 1 || m.fibre_tension != 0)
    std::printf("  along fibres        %.4g times as stiff, tension %.4g\n",
                m.fibre_stiffness_ratio, m.fibre_tension);
}

void print_measured(const material::HyperelasticMaterial& m) {
  std::printf("  elasticity          measured, %s (%s)\n", m.name.c_str(), m.source.c_str());
  if (m.energy == material::StrainEnergy::Exponential) {
    std::printf("  C10, exponent       %.4g kPa, %.4g", m.coefficients_pa[0] / 1e3, m.exponent);
  } else {
    std::printf("  C10 to C50         ");
    for (const double c : m.coefficients_pa) std::printf(" %.4g", c / 1e3);
    std::printf(" kPa");
  }
  std::printf("; bulk modulus %.4g kPa\n", m.bulk_modulus_pa / 1e3);
  for (const auto& [weight, time_s] : m.relaxation)
    std::printf("  relaxes             by %.4g in %.4g s\n", weight, time_s);
}

void print_material(const material::Material& m) {
  if (m.elastic_law == material::ElasticLaw::Measured)
    print_measured(m.measured);
  else if (m.elastic_law != material::ElasticLaw::Springs)
    std::printf("  elasticity          %s, Young's modulus %.4g kPa, Poisson's ratio %.4g\n",
                name_of(m.elastic_law), m.young_modulus_pa / 1e3, m.poisson_ratio);
  else if (m.spring_law == material::SpringLaw::Constant)
    std::printf("  springs             constant, %.4g N/m\n", m.spring_stiffness_n_m);
  else
    std::printf("  springs             from Young's modulus %.4g kPa\n", m.young_modulus_pa / 1e3);
  if (m.has_averaged_strain) std::printf("  strain              averaged over nodes\n");
  print_fibres(m);
  if (m.tension > 0) std::printf("  tension             %.4g\n", m.tension);
  std::printf("  cutting             %.4g J/m^2 of wound, %.4g kPa on the blade's sides\n",
              m.cut_energy_j_m2, m.blade_friction_pa / 1e3);
  if (m.tear_stretch > 0)
    std::printf("  tears               at %.4g times its length\n", m.tear_stretch);
  std::printf("  density             %.4g kg/m^3\n", m.density_kg_m3);
  std::printf("  damping             %.4g 1/s per node, %.4g ms along edges\n",
              m.node_damping_per_s, m.edge_damping_time_s * 1e3);
}

void print_materials(const organ::Organ& organ) {
  print_material(organ.material);
  if (!organ.fibre_directions.empty())
    std::printf("  directed fibres     at %s nodes\n", grouped(nodes_with_fibres(organ)).c_str());
  for (const auto& region : organ.regions) {
    std::printf("  region              %s, %s nodes%s%s:\n", region.name.c_str(),
                grouped(region.nodes.size()).c_str(), region.look.empty() ? "" : ", look ",
                region.look.c_str());
    print_material(region.material);
  }
  for (const auto& [name, law, ties] : organ.ties)
    std::printf("  ties                %s, %s, %.4g J/m^2, %.4g kPa at %.4g mm\n", name.c_str(),
                grouped(ties.size()).c_str(), law.toughness_j_m2, law.strength_pa / 1e3,
                law.rise_m * 1e3);
  const Vec3d& g = organ.gravity_m_s2;
  if (length(g) > 0) std::printf("  gravity             %.4g %.4g %.4g m/s^2\n", g.x, g.y, g.z);
  if (!organ.stress_free_positions_m.empty())
    std::printf("  rest pose           settled, in equilibrium\n");
}

// How many tets have their smallest dihedral angle in each class, with a bar of at most 40 signs.
void print_quality(const mesh::TetMesh& mesh) {
  const auto counts = mesh::dihedral_histogram(mesh);
  const std::size_t most = std::max<std::size_t>(*std::ranges::max_element(counts), 1);
  for (std::size_t c = 0; c < counts.size(); ++c)
    if (counts[c] > 0)
      std::printf("    smallest %2zu to %2zu  %9s %s\n", 10 * c, 10 * (c + 1),
                  grouped(counts[c]).c_str(),
                  std::string((40 * counts[c] + most - 1) / most, '#').c_str());
}

Json array_of(const Vec3d& v) {
  return {v.x, v.y, v.z};
}

void add_material(const material::Material& m, Json& json) {
  json["elastic_law"] = name_of(m.elastic_law);
  if (m.elastic_law == material::ElasticLaw::Measured) json["measured"] = m.measured.name;
  json["averaged_strain"] = m.has_averaged_strain;
  json["spring_law"] =
      m.spring_law == material::SpringLaw::Constant ? "constant" : "volume_consistent";
  for (const auto& key : material::kNumberKeys) json[std::string(key.key)] = m.*key.member;
  json["fibre_direction"] = array_of(m.fibre_direction);
}

}  // namespace

std::string grouped(std::size_t number) {
  std::string digits = std::to_string(number);
  for (auto i = static_cast<int>(digits.size()) - 3; i > 0; i -= 3)
    digits.insert(static_cast<std::size_t>(i), 1, ',');
  return digits;
}

const char* name_of(material::ElasticLaw law) {
  switch (law) {
    case material::ElasticLaw::Springs:
      return "springs";
    case material::ElasticLaw::TensorMass:
      return "tensor-mass";
    case material::ElasticLaw::NeoHookean:
      return "neo-hookean";
    case material::ElasticLaw::Measured:
      return "measured";
  }
  return "";
}

void print_text(const organ::Organ& organ) {
  const mesh::TetMesh& mesh = organ.mesh;
  const Vec3d size = organ::size_of(mesh) * 1e3;
  const EdgeLengths edges = edge_lengths(mesh);
  std::printf("%s  (%s)\n", organ.name.c_str(), organ.source.c_str());
  std::printf("  nodes               %s, %s of them on the surface\n",
              grouped(mesh.node_count()).c_str(), grouped(mesh.surface_nodes.size()).c_str());
  std::printf("  tets                %s\n", grouped(mesh.tets.size()).c_str());
  if (mesh.links.empty())
    std::printf("  edges               %s\n", grouped(mesh.edges.size()).c_str());
  else
    std::printf("  links               %s\n", grouped(mesh.links.size()).c_str());
  std::printf("  surface triangles   %s\n", grouped(mesh.boundary_triangles.size()).c_str());
  if (const auto& fine = organ.fine_surface; !fine.empty())
    std::printf("  fine surface        %s triangles, %s vertices%s\n",
                grouped(fine.triangles.size()).c_str(), grouped(fine.quanta.size()).c_str(),
                fine.picture.empty() ? "" : ", with a picture");
  std::printf("  size                %.1f x %.1f x %.1f mm\n", size.x, size.y, size.z);
  const Vec3d offset = organ.source_offset_m * 1e3;
  const auto rounded = [](double mm) { return std::round(mm * 1e3) / 1e3 + 0.0; };
  std::printf(
      "  offset              %.10g %.10g %.10g mm: add it to a position to get the source's\n",
      rounded(offset.x), rounded(offset.y), rounded(offset.z));
  std::printf("  volume              %.4g l\n", organ::enclosed_volume(mesh) * 1e3);
  std::printf("  mass                %.4g kg\n", organ::mass_kg(organ));
  std::printf("  edge lengths        %.2f / %.2f / %.2f mm (least, mean, largest)\n", edges.min_mm,
              edges.mean_mm, edges.max_mm);
  if (!mesh.tets.empty()) {
    const auto angles = mesh::dihedral_range(mesh);
    std::printf("  dihedral angles     %.1f to %.1f degrees\n", angles.min_deg, angles.max_deg);
    print_quality(mesh);
  }
  print_materials(organ);
  std::printf("  fixed nodes         %s (%.1f %%)\n", grouped(organ.fixed_nodes.size()).c_str(),
              100.0 * static_cast<double>(organ.fixed_nodes.size()) /
                  static_cast<double>(mesh.node_count()));
  std::printf("  hash                %016" PRIx64 "\n", organ::organ_hash(organ));
}

void print_json(const organ::Organ& organ) {
  const mesh::TetMesh& mesh = organ.mesh;
  const EdgeLengths edges = edge_lengths(mesh);
  Json json{{"name", organ.name},
            {"source", organ.source},
            {"nodes", mesh.node_count()},
            {"surface_nodes", mesh.surface_nodes.size()},
            {"tets", mesh.tets.size()},
            {"edges", mesh.edges.size()},
            {"links", mesh.links.size()},
            {"surface_triangles", mesh.boundary_triangles.size()},
            {"size_mm", array_of(organ::size_of(mesh) * 1e3)},
            {"volume_l", organ::enclosed_volume(mesh) * 1e3},
            {"mass_kg", organ::mass_kg(organ)},
            {"edge_mm", {{"min", edges.min_mm}, {"mean", edges.mean_mm}, {"max", edges.max_mm}}},
            {"dihedral_deg", nullptr}};
  if (!mesh.tets.empty()) {
    const auto angles = mesh::dihedral_range(mesh);
    json["dihedral_deg"] = {{"min", angles.min_deg}, {"max", angles.max_deg}};
    json["smallest_dihedral_per_10_deg"] = mesh::dihedral_histogram(mesh);
  }
  add_material(organ.material, json);
  json["fibre_nodes"] = nodes_with_fibres(organ);
  json["regions"] = organ.regions.size();
  json["ties"] = organ::tie_count(organ.ties);
  json["gravity_m_s2"] = array_of(organ.gravity_m_s2);
  json["settled"] = !organ.stress_free_positions_m.empty();
  json["source_offset_m"] = array_of(organ.source_offset_m);
  json["fixed_nodes"] = organ.fixed_nodes.size();
  json["hash"] = hex64(organ::organ_hash(organ));
  std::fputs(to_text(json).c_str(), stdout);
}

}  // namespace trocar::app
