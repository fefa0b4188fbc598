// trocar-organ: makes, imports, inspects and settles organs, and fits their material.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/log.h"
#include "common/base/printable.h"
#include "common/base/program.h"
#include "common/base/stdout_check.h"
#include "common/base/version.h"
#include "common/command_line/command_line.h"
#include "common/command_line/limits.h"
#include "server/app/organ/organ_calibrate.h"
#include "server/app/organ/organ_edit.h"
#include "server/app/organ/organ_embed.h"
#include "server/app/organ/organ_experiments.h"
#include "server/app/organ/organ_export.h"
#include "server/app/organ/organ_identify.h"
#include "server/app/organ/organ_print.h"
#include "server/app/organ/organ_reduce.h"
#include "server/app/organ/program_name.h"
#include "server/lab/scenario/scenario.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/import_organ.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/catalogue/part_file.h"
#include "server/organs/dicom/dicom_reader.h"
#include "server/organs/label_map/nifti_reader.h"
#include "server/organs/material/material_file.h"
#include "server/organs/mesh/fill_field.h"
#include "server/organs/organ/any_material.h"
#include "server/organs/organ/average_strain.h"
#include "server/organs/organ/fibre_rule.h"
#include "server/organs/organ/organ_file.h"

namespace trocar::app {
namespace {

// From here on the work takes longer than two seconds, and a line says that it goes on.
constexpr int kManyTets = 100'000, kManyNodes = 20'000;
constexpr std::uintmax_t kLargeFileBytes = 20'000'000;
constexpr std::string_view kFixSet = "set:";

constexpr const char* kExamples = R"(
Examples:
  trocar-organ list
      the built-in organs
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
  trocar-organ import spleen.msh --law neo-hookean --young-modulus 6000
      the same mesh, in metres, of neo-Hookean tets of 6 kPa
  trocar-organ import spleen.stl --unit mm --nodes 2000
      a closed surface, filled with tets
  trocar-organ import spleen.stl --unit mm --nodes 2000 --embed spleen.stl
      the same, drawn as finely as the file is
  trocar-organ import scan.nii.gz --labels 1:liver,2:tumour
      two structures of a segmented scan, as one organ of two regions
  trocar-organ inspect spleen.organ --json
      its figures, for other programs
  trocar-organ inspect spleen.organ --picture spleen.png
      its figures, and how it looks from three sides
  trocar-organ edit spleen.organ
      a window in which its nodes are held, its regions painted, and its tissue pressed
  trocar-organ edit spleen.organ --headless --release all --hold y=..-40,surface --out low.organ
      the same without a window: held below y = -40 mm, into low.organ
  trocar-organ export spleen.organ --out spleen.vtu --unit mm
      its mesh, for ParaView
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
  std::optional<int> import_nodes;
  std::string import_labels;
  EmbedCommand embedded;
  bool unit_is_said = false;
  std::string law;
  std::optional<double> young_modulus_pa, poisson_ratio;
  std::string inspected;
  bool json = false;
  std::string picture;
  std::optional<bool> has_averaged_strain;
  ExportCommand exported;
  edit_command::EditCommand edited;
  FitCommand fit;
  SettleCommand settle;
  CalibrateCommand calibrate;
  IdentifyCommand identify;
  ReduceCommand reduce;
};

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
  resolved->organ.name =
      as_name(std::filesystem::path(path).stem().string(), organ::kMostNameBytes);
  return std::move(resolved->organ);
}

Result<organ::Organ> make_named(const std::string& name, const std::optional<int>& tets) {
  if (std::filesystem::path(name).extension() == ".toml" && !catalogue::is_part_file(name))
    return make_from_scenario(name, tets);
  if (name == "lattice") {
    if (tets)
      return Error{ErrorCode::Usage, "make lattice: --tets does not apply, a lattice has none"};
    return catalogue::make_lattice();
  }
  if (name == "plate" || name == "chest" || name == "pegs" || name.ends_with(".toml")) {
    if (tets)
      return Error{ErrorCode::Usage, "make " + name + ": --tets does not apply, its mesh is given"};
    return catalogue::load_organ(name);
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

// averages: strain is averaged unless the options say otherwise; else it is as the organ has it.
Status change_organ(const Options& options, bool averages, organ::Organ& organ) {
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
  const bool is_averaged = averages && organ::any_material(organ, material::is_hyperelastic);
  if (options.has_averaged_strain.value_or(is_averaged)) {
    if (auto averaged = organ::average_strain(organ); !averaged) return averaged;
  } else if (options.has_averaged_strain) {
    organ::use_plain_strain(organ);
  }
  const auto set = [](const std::optional<double>& from, double& to) { to = from.value_or(to); };
  set(options.tension, material.tension);
  set(options.fibre_tension, material.fibre_tension);
  set(options.fibre_stiffness_ratio, material.fibre_stiffness_ratio);
  set(options.tear_stretch, material.tear_stretch);
  set(options.cut_energy_j_m2, material.cut_energy_j_m2);
  set(options.blade_friction_pa, material.blade_friction_pa);
  return organ::validate(organ);
}

// Checked before any work is done.
Status check_out(const Options& options) {
  return options.out.empty() ? Status() : organ::check_organ_name(options.out);
}

Status run_make(const Options& options) {
  if (auto status = check_out(options); !status) return status;
  auto organ = make_named(options.made_name, options.tets);
  if (!organ) return organ.error();
  if (auto changed = change_organ(options, !options.material.empty(), *organ); !changed)
    return changed;
  const auto stem = std::filesystem::path(options.made_name).stem().string();
  return save(*organ, options.out.empty() ? stem + ".organ" : options.out);
}

// The imported tissue is made of this, unless --material says it.
Status choose_law(const Options& options, material::Material& material) {
  static const std::map<std::string, material::ElasticLaw> kLaws{
      {"springs", material::ElasticLaw::Springs},
      {"tensor-mass", material::ElasticLaw::TensorMass},
      {"neo-hookean", material::ElasticLaw::NeoHookean}};
  const bool is_chosen = !options.law.empty() || options.young_modulus_pa || options.poisson_ratio;
  if (!options.material.empty())
    return is_chosen ? Status{Error{ErrorCode::Usage,
                                    "--material: a measured material has its own law and moduli; "
                                    "remove --law, --young-modulus and --poisson-ratio"}}
                     : Status{};
  if (!options.law.empty()) material.elastic_law = kLaws.at(options.law);
  if (options.poisson_ratio && material.elastic_law == material::ElasticLaw::Springs)
    return Error{ErrorCode::Usage,
                 "--poisson-ratio: springs have 1/4 whatever is asked; choose --law neo-hookean or "
                 "tensor-mass"};
  material.young_modulus_pa = options.young_modulus_pa.value_or(material.young_modulus_pa);
  material.poisson_ratio = options.poisson_ratio.value_or(material.poisson_ratio);
  return {};
}

void say_what_was_chosen(const Options& options, const material::Material& m) {
  if (!options.material.empty() || (!options.law.empty() && options.young_modulus_pa)) return;
  std::fprintf(stderr,
               "%s: %s: chosen, as nothing was asked for: %s%sYoung's modulus %.4g kPa "
               "(--law, --young-modulus or --material choose others)\n",
               kProgram, options.import_file.c_str(),
               options.law.empty() ? name_of(m.elastic_law) : "", options.law.empty() ? ", " : "",
               m.young_modulus_pa / 1e3);
}

// Imported regions differ in name only; scenarios give them materials of their own.
void give_regions_its_material(organ::Organ& organ) {
  for (auto& region : organ.regions) region.material = organ.material;
}

Result<catalogue::ImportedOrgan> read(const std::filesystem::path& path,
                                      const catalogue::ImportOptions& options) {
  if (!dicom::is_dicom(path)) return catalogue::import_organ(path, options);
  if (options.unit_is_said)
    return Error{ErrorCode::Usage, path.string() + ": --unit does not apply, DICOM is in mm"};
  auto map = dicom::read_dicom(path);
  if (!map) return map.error();
  return catalogue::import_labels(std::move(*map), path, options);
}

Status run_import(const Options& options) {
  if (auto status = check_out(options); !status) return status;
  const auto unit = mesh::parse_unit(options.unit);
  if (!unit) return unit.error();
  catalogue::ImportOptions import_options;
  import_options.unit = *unit;
  import_options.unit_is_said = options.unit_is_said;
  import_options.nodes = options.import_nodes;
  const auto labels = catalogue::parse_labels(options.import_labels);
  if (!labels) return labels.error();
  import_options.labels = *labels;
  if (options.fix.starts_with(kFixSet)) {
    import_options.fix_set = options.fix.substr(kFixSet.size());
  } else {
    const auto fix = organ::parse_fix_rule(options.fix);
    if (!fix) return fix.error();
    import_options.fix = *fix;
  }
  if (!options.import_name.empty()) import_options.name = options.import_name;
  std::filesystem::path path(options.import_file);
  if (!path.has_filename()) path = path.parent_path();  // of a folder with a slash at its end
  std::error_code missing;
  if (const auto bytes = std::filesystem::file_size(path, missing);
      !missing && bytes >= kLargeFileBytes)
    std::fprintf(stderr, "%s: reading %s, %s MB, this takes some seconds\n", kProgram,
                 options.import_file.c_str(), grouped(bytes / 1'000'000).c_str());
  if (options.import_nodes.value_or(0) >= kManyNodes)
    std::fprintf(stderr, "%s: filling %s with about %s nodes, this takes some seconds\n", kProgram,
                 options.import_file.c_str(),
                 grouped(static_cast<std::size_t>(*options.import_nodes)).c_str());
  auto imported = read(path, import_options);
  if (!imported) return imported.error();
  if (auto chosen = choose_law(options, imported->organ.material); !chosen) return chosen;
  give_regions_its_material(imported->organ);
  if (auto changed = change_organ(options, true, imported->organ); !changed) return changed;
  give_regions_its_material(imported->organ);
  EmbedPlace place{options.import_file, imported->unit_m, imported->axes, imported->axes};
  if (dicom::is_dicom(path))
    place.axes = surface::Axes::Lps;
  else if (label_map::is_nifti_file(path))
    place.axes = surface::Axes::Ras;
  if (auto embedded = embed_surface(options.embedded, place, imported->organ); !embedded)
    return embedded;
  for (const std::string& note : imported->notes)
    std::fprintf(stderr, "%s: %s: %s\n", kProgram, options.import_file.c_str(), note.c_str());
  say_what_was_chosen(options, imported->organ.material);
  for (const std::string& warning : imported->warnings)
    std::fprintf(stderr, "%s: warning: %s: %s\n", kProgram, options.import_file.c_str(),
                 warning.c_str());
  if (imported->organ.fixed_nodes.empty())
    std::fprintf(stderr, "%s: warning: %s: nothing holds this organ, a push moves all of it\n",
                 kProgram, options.import_file.c_str());
  return save(imported->organ,
              options.out.empty() ? catalogue::imported_name(path) + ".organ" : options.out);
}

Status run_inspect(const Options& options) {
  if (!options.picture.empty() && std::filesystem::path(options.picture).extension() != ".png")
    return Error{ErrorCode::Usage,
                 "--picture: " + options.picture + ": the file's name must end with .png"};
  const auto organ = catalogue::load_organ(options.inspected);
  if (!organ) return organ.error();
  options.json ? print_json(*organ) : print_text(*organ);
  return options.picture.empty() ? Status{} : draw(*organ, options.picture);
}

std::string version_text() {
  return std::string(kProgram) + " " + kVersion + ", sim_version " + std::to_string(kSimVersion) +
         ", protocol " + std::to_string(kProtocolMajor) + "." + std::to_string(kProtocolMinor);
}

std::string range(int low, int high, int usual) {
  return std::to_string(low) + " to " + std::to_string(high) + " [" + std::to_string(usual) + "]";
}

void print_built_in_organs() {
  for (const auto& each : catalogue::built_in_organs())
    std::printf("%-14s %s\n", each.name, each.text);
}

void add_commands(CLI::App& app, Options& options) {
  auto* make = app.add_subcommand("make", "make a built-in organ, or that of a scenario");
  make->add_option("NAME", options.made_name,
                   "a built-in organ, which list shows; a part file (.toml); or a scenario's .toml "
                   "file: its organ with its materials, regions and held nodes")
      ->required()
      ->check([](const std::string& name) -> std::string {
        if (name.ends_with(".toml")) return {};
        for (const auto& each : catalogue::built_in_organs())
          if (name == each.name) return {};
        return catalogue::no_built_in(name);
      });
  make->add_option("--tets", options.tets,
                   "how many tets, met within 5 %: liver " +
                       range(catalogue::kMinLiverTets, catalogue::kMaxLiverTets,
                             catalogue::kDefaultLiverTets) +
                       ", stomach " +
                       range(catalogue::kMinStomachTets, catalogue::kMaxStomachTets,
                             catalogue::kDefaultStomachTets))
      ->type_name("N");
  make->add_option("--out", options.out, "file to write [NAME.organ]")->type_name("FILE");

  app.add_subcommand("list", "list the built-in organs");

  auto* import =
      app.add_subcommand("import", "turn a mesh, a closed surface or a label map into an organ");
  import
      ->add_option(
          "FILE", options.import_file,
          "tetrahedra: Gmsh .msh, VTK .vtk or .vtu, TetGen .ele beside "
          ".node, MEDIT .mesh, "
          "Abaqus .inp; surfaces: .stl, .obj, .ply, .glb, .vtk; label maps: .nii, .nii.gz, "
          "a DICOM segmentation, or the folder of a DICOM series")
      ->required();
  import
      ->add_option(
          "--nodes", options.import_nodes,
          "of a surface or a label map: how many nodes its mesh has, met within 15 %, " +
              range(mesh::kMinFillNodes, mesh::kMaxFillNodes, catalogue::kDefaultFillNodes))
      ->type_name("N");
  import
      ->add_option("--labels", options.import_labels,
                   "of a label map: which make the organ, such as 1:liver,2:tumour, or by the "
                   "names that the file gives them [all but 0]")
      ->type_name("LIST");
  import
      ->add_option("--unit", options.unit,
                   "length unit of the file: m, cm or mm; a label map says its own")
      ->type_name("UNIT")
      ->capture_default_str();
  import
      ->add_option("--fix", options.fix,
                   "which surface nodes are held: bottom:F, top:F, back:F (share "
                   "of the height or "
                   "depth), set:NAME (a set of the file), or none")
      ->type_name("RULE")
      ->capture_default_str();
  import->add_option("--name", options.import_name, "name of the organ [the file's]")
      ->type_name("NAME");
  add_embed_options(*import, options.embedded);
  import->add_option("--out", options.out, "file to write [<file's name>.organ, here]")
      ->type_name("FILE");

  import->add_option("--law", options.law, "springs, tensor-mass or neo-hookean [springs]")
      ->type_name("LAW")
      ->check(command_line::one_of({"springs", "tensor-mass", "neo-hookean"}));
  import->add_option("--young-modulus", options.young_modulus_pa, "of its tissue, Pa [4000]")
      ->type_name("E")
      ->check(command_line::from_to(1, 1e12));
  import
      ->add_option("--poisson-ratio", options.poisson_ratio,
                   "of tensor-mass and neo-hookean tissue, 0 to 0.4999 [0.45]")
      ->type_name("NU")
      ->check(command_line::from_to(0, 0.4999));

  auto* inspect = app.add_subcommand("inspect", "check an organ and print its figures");
  inspect
      ->add_option("FILE", options.inspected,
                   ".organ file, a mesh or surface as import reads it, or a "
                   "built-in organ's name")
      ->required();
  inspect->add_flag("--json", options.json, "print JSON");
  inspect
      ->add_option("--picture", options.picture,
                   "also draw it from three sides, into this .png file")
      ->type_name("FILE");
  add_export_command(app, options.exported);
  edit_command::add_options(
      *app.add_subcommand("edit", "hold nodes, paint regions and try an organ, in a window"),
      options.edited);
  for (auto* command : {make, import}) {
    command
        ->add_option("--material", options.material,
                     "measured material of its tets: " + material::measured_material_names() +
                         ", or a .toml file as identify leaves it")
        ->type_name("NAME");
    command->add_flag("--averaged-strain", options.has_averaged_strain,
                      "average strain over nodes, so that tets do not lock; =false: plain tets, "
                      "up "
                      "to 50 % too stiff [averaged: liver, --material, imports that are not of "
                      "springs or tensor-mass]");
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
                     "where fibres run: x, y or z; around:x, around:y or "
                     "around:z; or a .csv file "
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
  const auto parsed = command_line::parse_command_line(app, argc, argv);
  if (!parsed) return report(kProgram, parsed.error());
  if (!*parsed) return static_cast<int>(ExitCode::Ok);
  // CLI11 writes false where nobody has said anything.
  const auto says = [&app](const char* command) {
    return app.got_subcommand(command) &&
           app.get_subcommand(command)->count("--averaged-strain") > 0;
  };
  options.unit_is_said =
      app.got_subcommand("import") && app.get_subcommand("import")->count("--unit") > 0;
  if (!says("make") && !says("import")) options.has_averaged_strain.reset();
  if (const auto set = log::configure(kProgram, options.log_level); !set)
    return report(kProgram, set.error());
  Status status;
  if (app.got_subcommand("list"))
    print_built_in_organs();
  else if (app.got_subcommand("make"))
    status = run_make(options);
  else if (app.got_subcommand("import"))
    status = run_import(options);
  else if (app.got_subcommand("export"))
    status = run_export(options.exported);
  else if (app.got_subcommand("edit"))
    status = run_edit(options.edited, argc, argv);
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
  trocar::begin_program("trocar-organ");
  return trocar::finish_output("trocar-organ", trocar::app::run(argc, argv));
}
