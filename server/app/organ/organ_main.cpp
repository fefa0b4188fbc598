// trocar-organ: makes, imports, inspects and settles organs, and fits their material.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cinttypes>
#include <cstdio>
#include <filesystem>
#include <numeric>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/cpu.h"
#include "common/base/log.h"
#include "common/base/quote.h"
#include "common/base/version.h"
#include "server/app/organ/organ_calibrate.h"
#include "server/app/organ/organ_experiments.h"
#include "server/app/organ/organ_identify.h"
#include "server/app/organ/organ_reduce.h"
#include "server/lab/scenario/scenario.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/material/material_file.h"
#include "server/organs/organ/average_strain.h"
#include "server/organs/organ/fibre_rule.h"
#include "server/organs/organ/organ_file.h"

namespace trocar::app {
namespace {

constexpr const char* kProgram = "trocar-organ";
// From here on the work takes longer than two seconds, and a line says that it goes on.
constexpr int kManyTets = 100'000;
constexpr std::uintmax_t kLargeFileBytes = 20'000'000;

constexpr const char* kExamples = R"(
Examples:
  trocar-organ make liver
      the built-in liver with about 4,000 nodes, into liver.organ
  trocar-organ make liver --tets 100000 --out fine.organ
      the same liver, finer
  trocar-organ make stomach
      a hollow one, its wall two tets thick or more, into stomach.organ
  trocar-organ make liver --tension 0.05 --tear-stretch 1.5 --out friable.organ
      one whose wounds gape, and which tears when it is pulled half as long again
  trocar-organ make stomach --fibres around:y --fibre-tension 0.08
      fibres around its height: a wound along its length gapes, one around it hardly
  trocar-organ make deploy/scenes/tumour.toml
      the organ of a scenario, here of several materials, into tumour.organ
  trocar-organ import spleen.msh --unit mm --fix back:0.1
      a mesh in millimetres, held at the hindmost tenth, into spleen.organ
  trocar-organ inspect spleen.organ --json
      its figures, for other programs
  trocar-organ settle spleen.organ --gravity 0,-9.81,0
      its rest pose under gravity, in which it starts without sagging, into spleen-settled.organ
  trocar-organ fit deploy/scenes/stretch.toml deploy/scenes/stretch.csv
      Young's modulus from a measured force-displacement curve; results in out/fit-stretch
  trocar-organ calibrate liver --error 3
      how much must move for a contact of a given force, into liver-calibrated.organ
  trocar-organ identify deploy/scenes/relax.csv --length-mm 20 --area-mm2 100
      C_i0, g_k and tau_k from curves of specimens; results in out/identify-relax
  trocar-organ reduce liver --modes 8
      a reduced model of eight unknowns, into liver.reduction; how far it is off in out/reduce-liver

Exit codes: 0 ok, 2 command line, 3 bad file, 5 cannot write or processor too old.
)";

struct Options {
  std::string log_level = "info";
  std::string made_name;
  std::optional<int> tets;
  std::optional<double> tension, tear_stretch, cut_energy_j_m2, blade_friction_pa;
  std::optional<double> fibre_tension, fibre_stiffness_ratio;
  std::string fibres, material;
  std::string out;
  std::string import_file;
  std::string unit = "m";
  std::string fix = "bottom:0.2";
  std::string import_name;
  std::string inspected;
  bool json = false;
  bool has_averaged_strain = false;
  FitCommand fit;
  SettleCommand settle;
  CalibrateCommand calibrate;
  IdentifyCommand identify;
  ReduceCommand reduce;
};

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

// Returns the volume that the surface encloses: that of the tets where there are any, and that of a
// lattice too.
double enclosed_volume(const mesh::TetMesh& mesh) {
  double volume = 0;
  for (const auto& [a, b, c] : mesh.boundary_triangles)
    volume += dot(cross(mesh.rest_positions[a.value], mesh.rest_positions[b.value]),
                  mesh.rest_positions[c.value]) /
              6;
  return volume;
}

Vec3d size_mm(const mesh::TetMesh& mesh) {
  Vec3d half{};  // the rest bounding box is centred on the origin
  for (const Vec3d& p : mesh.rest_positions)
    half = {std::max(half.x, p.x), std::max(half.y, p.y), std::max(half.z, p.z)};
  return half * 2e3;
}

double mass_kg(const organ::Organ& organ) {
  return std::accumulate(organ.node_masses_kg.begin(), organ.node_masses_kg.end(), 0.0);
}

std::string grouped(std::size_t number) {
  std::string digits = std::to_string(number);
  for (auto i = static_cast<int>(digits.size()) - 3; i > 0; i -= 3)
    digits.insert(static_cast<std::size_t>(i), ",");
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
  std::printf("  damping             %.4g 1/s per node, %.4g ms along springs\n",
              m.node_damping_per_s, m.spring_damping_time_s * 1e3);
}

void print_materials(const organ::Organ& organ) {
  print_material(organ.material);
  if (!organ.fibre_directions.empty())
    std::printf("  directed fibres     at %s nodes\n", grouped(nodes_with_fibres(organ)).c_str());
  for (const auto& region : organ.regions) {
    std::printf("  region              %s, %s nodes:\n", region.name.c_str(),
                grouped(region.nodes.size()).c_str());
    print_material(region.material);
  }
  const Vec3d& g = organ.gravity_m_s2;
  if (length(g) > 0) std::printf("  gravity             %.4g %.4g %.4g m/s^2\n", g.x, g.y, g.z);
  if (!organ.stress_free_positions_m.empty())
    std::printf("  rest pose           settled, in equilibrium\n");
}

void print_text(const organ::Organ& organ) {
  const mesh::TetMesh& mesh = organ.mesh;
  const Vec3d size = size_mm(mesh);
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
  std::printf("  size                %.1f x %.1f x %.1f mm\n", size.x, size.y, size.z);
  std::printf("  volume              %.4g l\n", enclosed_volume(mesh) * 1e3);
  std::printf("  mass                %.4g kg\n", mass_kg(organ));
  std::printf("  edge lengths        %.2f / %.2f / %.2f mm (least, mean, largest)\n", edges.min_mm,
              edges.mean_mm, edges.max_mm);
  if (!mesh.tets.empty()) {
    const auto angles = mesh::dihedral_range(mesh);
    std::printf("  dihedral angles     %.1f to %.1f degrees\n", angles.min_deg, angles.max_deg);
  }
  print_materials(organ);
  std::printf("  fixed nodes         %s (%.1f %%)\n", grouped(organ.fixed_nodes.size()).c_str(),
              100.0 * static_cast<double>(organ.fixed_nodes.size()) /
                  static_cast<double>(mesh.node_count()));
  std::printf("  hash                %016" PRIx64 "\n", organ::organ_hash(organ));
}

// A JSON string. Names in files may hold any UTF-8, so only what JSON forbids is escaped.
void print_json(const material::Material& m) {
  std::printf("  \"elastic_law\": \"%s\",\n  \"poisson_ratio\": %.9g,\n", name_of(m.elastic_law),
              m.poisson_ratio);
  if (m.elastic_law == material::ElasticLaw::Measured)
    std::printf("  \"measured\": %s,\n", quote(m.measured.name).c_str());
  std::printf("  \"averaged_strain\": %s,\n", m.has_averaged_strain ? "true" : "false");
  std::printf("  \"spring_law\": \"%s\",\n  \"spring_stiffness_n_m\": %.9g,\n",
              m.spring_law == material::SpringLaw::Constant ? "constant" : "volume_consistent",
              m.spring_stiffness_n_m);
  std::printf("  \"young_modulus_pa\": %.9g,\n  \"density_kg_m3\": %.9g,\n", m.young_modulus_pa,
              m.density_kg_m3);
  std::printf("  \"node_damping_per_s\": %.9g,\n  \"spring_damping_time_s\": %.9g,\n",
              m.node_damping_per_s, m.spring_damping_time_s);
  std::printf("  \"fibre_direction\": [%.9g, %.9g, %.9g],\n  \"fibre_stiffness_ratio\": %.9g,\n",
              m.fibre_direction.x, m.fibre_direction.y, m.fibre_direction.z,
              m.fibre_stiffness_ratio);
  std::printf("  \"fibre_tension\": %.9g,\n  \"tension\": %.9g,\n", m.fibre_tension, m.tension);
  std::printf(
      "  \"cut_energy_j_m2\": %.9g,\n  \"blade_friction_pa\": %.9g,\n  \"tear_stretch\": %.9g,\n",
      m.cut_energy_j_m2, m.blade_friction_pa, m.tear_stretch);
}

void print_json(const organ::Organ& organ) {
  const mesh::TetMesh& mesh = organ.mesh;
  const Vec3d size = size_mm(mesh);
  const EdgeLengths edges = edge_lengths(mesh);
  std::printf("{\n  \"name\": %s,\n  \"source\": %s,\n", quote(organ.name).c_str(),
              quote(organ.source).c_str());
  std::printf("  \"nodes\": %zu,\n  \"surface_nodes\": %zu,\n  \"tets\": %zu,\n", mesh.node_count(),
              mesh.surface_nodes.size(), mesh.tets.size());
  std::printf("  \"edges\": %zu,\n  \"links\": %zu,\n  \"surface_triangles\": %zu,\n",
              mesh.edges.size(), mesh.links.size(), mesh.boundary_triangles.size());
  std::printf("  \"size_mm\": [%.6g, %.6g, %.6g],\n  \"volume_l\": %.9g,\n  \"mass_kg\": %.9g,\n",
              size.x, size.y, size.z, enclosed_volume(mesh) * 1e3, mass_kg(organ));
  std::printf("  \"edge_mm\": {\"min\": %.6g, \"mean\": %.6g, \"max\": %.6g},\n", edges.min_mm,
              edges.mean_mm, edges.max_mm);
  if (mesh.tets.empty()) {
    std::printf("  \"dihedral_deg\": null,\n");
  } else {
    const auto angles = mesh::dihedral_range(mesh);
    std::printf("  \"dihedral_deg\": {\"min\": %.6g, \"max\": %.6g},\n", angles.min_deg,
                angles.max_deg);
  }
  print_json(organ.material);
  std::printf("  \"fibre_nodes\": %zu,\n", nodes_with_fibres(organ));
  std::printf("  \"regions\": %zu,\n  \"gravity_m_s2\": [%.9g, %.9g, %.9g],\n  \"settled\": %s,\n",
              organ.regions.size(), organ.gravity_m_s2.x, organ.gravity_m_s2.y,
              organ.gravity_m_s2.z, organ.stress_free_positions_m.empty() ? "false" : "true");
  std::printf("  \"source_offset_m\": [%.9g, %.9g, %.9g],\n", organ.source_offset_m.x,
              organ.source_offset_m.y, organ.source_offset_m.z);
  std::printf("  \"fixed_nodes\": %zu,\n  \"hash\": \"%016" PRIx64 "\"\n}\n",
              organ.fixed_nodes.size(), organ::organ_hash(organ));
}

Status save(const organ::Organ& organ, const std::string& path) {
  if (auto status = organ::write_organ(path, organ); !status) return status;
  print_text(organ);
  std::error_code ignored;
  std::printf("  file                %s, %s bytes\n", path.c_str(),
              grouped(std::filesystem::file_size(path, ignored)).c_str());
  return {};
}

// Makes the organ of a scenario, with its materials, regions and held nodes.
Result<organ::Organ> make_from_scenario(const std::string& path, const std::optional<int>& tets) {
  if (tets)
    return Error{ErrorCode::Usage, "make " + path +
                                       ": --tets does not apply, the scenario says "
                                       "what its organ is"};
  auto parsed = scenario::parse_scenario(path);
  if (!parsed) return parsed.error();
  auto resolved = scenario::resolve(std::move(*parsed));
  if (!resolved) return resolved.error();
  resolved->organ.name = std::filesystem::path(path).stem().string();
  return std::move(resolved->organ);
}

Result<organ::Organ> make_named(const std::string& name, const std::optional<int>& tets) {
  if (std::filesystem::path(name).extension() == ".toml") return make_from_scenario(name, tets);
  if (name == "lattice") {
    if (tets)
      return Error{ErrorCode::Usage, "make lattice: --tets does not apply, a lattice has none"};
    return catalogue::make_lattice();
  }
  if (name == "plate" || name == "chest") {
    if (tets)
      return Error{ErrorCode::Usage, "make " + name + ": --tets does not apply, its mesh is given"};
    return name == "plate" ? catalogue::make_plate() : catalogue::make_chest();
  }
  if (tets.value_or(0) >= kManyTets)
    std::fprintf(stderr, "%s: meshing a %s of about %s tets, this takes some seconds\n", kProgram,
                 name.c_str(), grouped(static_cast<std::size_t>(*tets)).c_str());
  if (name == "stomach")
    return catalogue::make_stomach(tets.value_or(catalogue::kDefaultStomachTets));
  const int count = tets.value_or(catalogue::kDefaultLiverTets);
  return name == "liver" ? catalogue::make_measured_liver(count) : catalogue::make_liver(count);
}

Status add_fibres(const Options& options, organ::Organ& organ) {
  if (!options.fibres.empty()) {
    const auto rule = organ::parse_fibre_rule(options.fibres);
    if (!rule) return rule.error();
    auto directions = organ::fibre_directions_by(*rule, organ.mesh);
    if (!directions) return directions.error();
    organ.fibre_directions = std::move(*directions);
  } else if (options.fibre_tension || options.fibre_stiffness_ratio) {
    return Error{ErrorCode::Usage,
                 "--fibre-tension, --fibre-stiffness: need --fibres, which says "
                 "where the fibres run"};
  }
  if (options.fibre_stiffness_ratio && organ.material.elastic_law != material::ElasticLaw::Springs)
    return Error{ErrorCode::Usage, "--fibre-stiffness: is of springs, this organ is of " +
                                       std::string(name_of(organ.material.elastic_law)) + " tets"};
  return {};
}

Status change_organ(const Options& options, organ::Organ& organ) {
  if (auto added = add_fibres(options, organ); !added) return added;
  if (options.tear_stretch.value_or(0) > 0 &&
      (organ.mesh.tets.empty() || !organ.mesh.links.empty()))
    return Error{ErrorCode::Usage,
                 "--tear-stretch: does not apply, organs of links do not tear, "
                 "only those of tets alone"};
  auto& material = organ.material;
  if (!options.material.empty()) {
    const auto measured = material::measured_material(options.material);
    if (!measured) return measured.error();
    material::use_measured(*measured, material);
  }
  if (options.has_averaged_strain)
    if (auto averaged = organ::average_strain(organ); !averaged) return averaged;
  const auto set = [](const std::optional<double>& from, double& to) { to = from.value_or(to); };
  set(options.tension, material.tension);
  set(options.fibre_tension, material.fibre_tension);
  set(options.fibre_stiffness_ratio, material.fibre_stiffness_ratio);
  set(options.tear_stretch, material.tear_stretch);
  set(options.cut_energy_j_m2, material.cut_energy_j_m2);
  set(options.blade_friction_pa, material.blade_friction_pa);
  return organ::validate(organ);
}

Status run_make(const Options& options) {
  auto organ = make_named(options.made_name, options.tets);
  if (!organ) return organ.error();
  if (auto changed = change_organ(options, *organ); !changed) return changed;
  const auto stem = std::filesystem::path(options.made_name).stem().string();
  return save(*organ, options.out.empty() ? stem + ".organ" : options.out);
}

Status run_import(const Options& options) {
  const auto unit = mesh::parse_unit(options.unit);
  if (!unit) return unit.error();
  const auto fix = organ::parse_fix_rule(options.fix);
  if (!fix) return fix.error();
  catalogue::ImportOptions import_options{*unit, *fix, std::nullopt};
  if (!options.import_name.empty()) import_options.name = options.import_name;
  const std::filesystem::path path(options.import_file);
  std::error_code missing;
  if (const auto bytes = std::filesystem::file_size(path, missing);
      !missing && bytes >= kLargeFileBytes)
    std::fprintf(stderr, "%s: reading %s, %s MB, this takes some seconds\n", kProgram,
                 options.import_file.c_str(), grouped(bytes / 1'000'000).c_str());
  auto imported = catalogue::import_organ(path, import_options);
  if (!imported) return imported.error();
  if (auto changed = change_organ(options, imported->organ); !changed) return changed;
  for (const std::string& warning : imported->warnings)
    std::fprintf(stderr, "%s: warning: %s: %s\n", kProgram, options.import_file.c_str(),
                 warning.c_str());
  if (imported->organ.fixed_nodes.empty())
    std::fprintf(stderr, "%s: warning: %s: nothing holds this organ, a push moves all of it\n",
                 kProgram, options.import_file.c_str());
  return save(imported->organ, options.out.empty() ? path.stem().string() + ".organ" : options.out);
}

Status run_inspect(const Options& options) {
  const auto organ = catalogue::load_organ(options.inspected);
  if (!organ) return organ.error();
  options.json ? print_json(*organ) : print_text(*organ);
  return {};
}

std::string version_text() {
  return std::string(kProgram) + " " + kVersion + ", sim_version " + std::to_string(kSimVersion) +
         ", protocol " + std::to_string(kProtocolMajor) + "." + std::to_string(kProtocolMinor);
}

void add_commands(CLI::App& app, Options& options) {
  auto* make = app.add_subcommand("make", "make a built-in organ, or that of a scenario");
  make->add_option("NAME", options.made_name,
                   "liver (human_liver_nava2008), elastic-liver (neo-Hookean), stomach, lattice "
                   "(Choi's 30 x 15 x 30 nodes), plate (Nakao's 16 x 16 x "
                   "0.4 cm) or "
                   "chest (wall and heart, the size of Nakao's); or a scenario's .toml file: its "
                   "organ with its materials, regions and held nodes")
      ->required()
      ->check([](const std::string& name) -> std::string {
        static constexpr std::array<std::string_view, 6> kNames{
            "liver", "elastic-liver", "stomach", "lattice", "plate", "chest"};
        if (name.ends_with(".toml") || std::ranges::find(kNames, name) != kNames.end()) return {};
        return name +
               ": is neither liver, elastic-liver, stomach, lattice, plate or chest nor a "
               ".toml file of a scenario";
      });
  const auto range = [](int low, int high, int usual) {
    return std::to_string(low) + " to " + std::to_string(high) + " [" + std::to_string(usual) + "]";
  };
  make->add_option("--tets", options.tets,
                   "how many tets, met within 5 %: liver " +
                       range(catalogue::kMinLiverTets, catalogue::kMaxLiverTets,
                             catalogue::kDefaultLiverTets) +
                       ", stomach " +
                       range(catalogue::kMinStomachTets, catalogue::kMaxStomachTets,
                             catalogue::kDefaultStomachTets))
      ->type_name("N");
  make->add_option("--out", options.out, "file to write [NAME.organ]")->type_name("FILE");

  auto* import = app.add_subcommand("import", "turn a Gmsh 2.2 ASCII mesh into an organ");
  import->add_option("FILE", options.import_file, ".msh file")->required();
  import->add_option("--unit", options.unit, "length unit of the file: m, cm or mm")
      ->type_name("UNIT")
      ->capture_default_str();
  import
      ->add_option("--fix", options.fix,
                   "which surface nodes are held: bottom:F, top:F, back:F (share of the height or "
                   "depth), or none")
      ->type_name("RULE")
      ->capture_default_str();
  import->add_option("--name", options.import_name, "name of the organ [the file's]")
      ->type_name("NAME");
  import->add_option("--out", options.out, "file to write [<file's name>.organ, here]")
      ->type_name("FILE");

  auto* inspect = app.add_subcommand("inspect", "check an organ and print its figures");
  inspect->add_option("FILE", options.inspected, ".organ or .msh file, or a built-in organ's name")
      ->required();
  inspect->add_flag("--json", options.json, "print JSON");
  for (auto* command : {make, import}) {
    command
        ->add_option("--material", options.material,
                     "measured material of its tets: " + material::measured_material_names() +
                         ", or a .toml file as identify leaves it")
        ->type_name("NAME");
    command->add_flag("--averaged-strain", options.has_averaged_strain,
                      "average strain over nodes: tets that lock are up to 40 % too stiff; a tick "
                      "takes three times as long");
    command->add_option("--tension", options.tension, "tissue would be shorter by this part [0]")
        ->type_name("PART");
    command
        ->add_option("--tear-stretch", options.tear_stretch,
                     "it tears when so many times as long; 0: never [0]")
        ->type_name("RATIO");
    command->add_option("--cut-energy", options.cut_energy_j_m2, "of a wound, J/m^2 [150]")
        ->type_name("E");
    command
        ->add_option("--blade-friction", options.blade_friction_pa,
                     "shear stress on each side of a blade, Pa [2000]")
        ->type_name("TAU");
    command
        ->add_option("--fibres", options.fibres,
                     "where fibres run: x, y or z; around:x, around:y or around:z; or a .csv file "
                     "with id,x,y,z for every node")
        ->type_name("RULE");
    command
        ->add_option("--fibre-tension", options.fibre_tension,
                     "tissue would be shorter along its fibres by this part, too [0]")
        ->type_name("PART");
    command
        ->add_option("--fibre-stiffness", options.fibre_stiffness_ratio,
                     "springs are so many times as stiff along the fibres [1]")
        ->type_name("RATIO");
  }
  add_fit_command(app, options.fit);
  add_settle_command(app, options.settle);
  add_calibrate_command(app, options.calibrate);
  add_identify_command(app, options.identify);
  add_reduce_command(app, options.reduce);
}

int run(int argc, char** argv) {
  Options options;
  CLI::App app(
      "Makes, imports, inspects and settles organs, the meshes, materials and held nodes that a "
      "session is about, and fits their material to a measurement.",
      kProgram);
  app.footer(kExamples);
  app.set_version_flag("--version", version_text());
  app.add_option("--log-level", options.log_level, "error, warn, info, debug or off")
      ->capture_default_str();
  app.require_subcommand(1);
  app.fallthrough();
  add_commands(app, options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    return report(kProgram, {ErrorCode::Usage, std::string(error.what()) + " (see --help)"});
  }
  if (const auto set = log::configure(kProgram, options.log_level); !set)
    return report(kProgram, set.error());
  Status status;
  if (app.got_subcommand("make"))
    status = run_make(options);
  else if (app.got_subcommand("import"))
    status = run_import(options);
  else if (app.got_subcommand("fit"))
    status = run_fit(options.fit);
  else if (app.got_subcommand("settle"))
    status = run_settle(options.settle);
  else if (app.got_subcommand("calibrate"))
    status = run_calibrate(options.calibrate);
  else if (app.got_subcommand("identify"))
    status = run_identify(options.identify);
  else if (app.got_subcommand("reduce"))
    status = run_reduce(options.reduce);
  else
    status = run_inspect(options);
  return status ? static_cast<int>(ExitCode::Ok) : report(kProgram, status.error());
}

}  // namespace
}  // namespace trocar::app

int main(int argc, char** argv) {
  trocar::require_cpu_features("trocar-organ");
  return trocar::app::run(argc, argv);
}
