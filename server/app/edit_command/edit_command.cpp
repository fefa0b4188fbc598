#include "server/app/edit_command/edit_command.h"

#include <algorithm>
#include <charconv>
#include <filesystem>

#include "common/base/log.h"
#include "common/base/size_option.h"
#include "common/command_line/limits.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/dicom/dicom_reader.h"
#include "server/organs/edit/box_rule.h"
#include "server/organs/edit/save.h"
#include "server/organs/material/material_file.h"
#include "server/organs/mesh/fill_field.h"

namespace trocar::edit_command {
namespace {

constexpr double kPoissonRatio = 0.45;

Result<organ::Organ> read(const EditCommand& command) {
  std::filesystem::path path(command.organ);
  if (!path.has_filename()) path = path.parent_path();  // of a folder with a slash at its end
  const bool is_import = !command.unit.empty() || command.nodes || !command.labels.empty();
  const bool is_dicom = dicom::is_dicom(path);
  if (!is_import) {
    // A built-in organ goes before a folder of its name.
    auto loaded = catalogue::load_organ(command.organ);
    if (loaded || !is_dicom) return loaded;
  }
  if (!is_dicom && !catalogue::can_be_imported(path))
    return Error{ErrorCode::Usage, command.organ +
                                       ": --unit, --nodes and --labels are of meshes, surfaces and "
                                       "label maps, remove them"};
  catalogue::ImportOptions options;
  options.unit_is_said = !command.unit.empty();
  options.nodes = command.nodes;
  if (options.unit_is_said) {
    const auto unit = mesh::parse_unit(command.unit);
    if (!unit) return unit.error();
    options.unit = *unit;
  }
  const auto labels = catalogue::parse_labels(command.labels);
  if (!labels) return labels.error();
  options.labels = *labels;
  if (is_dicom && options.unit_is_said)
    return Error{ErrorCode::Usage, path.string() + ": --unit does not apply, DICOM is in mm"};
  auto imported = [&]() -> Result<catalogue::ImportedOrgan> {
    if (!is_dicom) return catalogue::import_organ(path, options);
    auto map = dicom::read_dicom(path);
    if (!map) return map.error();
    return catalogue::import_labels(std::move(*map), path, options);
  }();
  if (!imported) return imported.error();
  for (const auto& note : imported->notes) log::info("{}: {}", command.organ, note);
  for (const auto& warning : imported->warnings) log::warn("{}: {}", command.organ, warning);
  return std::move(imported->organ);
}

Result<std::vector<NodeIndex>> nodes_of(std::string_view rule_text, std::string_view option,
                                        const edit::Editor& editor) {
  const auto rule = edit::parse_box_rule(rule_text, option);
  if (!rule) return rule.error();
  auto nodes = edit::nodes_in(*rule, editor.organ().mesh);
  if (nodes.empty())
    return Error{ErrorCode::Usage, std::string(option) + ": '" + std::string(rule_text) +
                                       "' has no nodes; positions are in mm, the origin is the "
                                       "centre of the organ's bounding box"};
  return nodes;
}

// Splits "NAME:REST" at the last colon.
Result<std::pair<std::string, std::string>> named(const std::string& text, const char* option) {
  const auto colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == text.size())
    return Error{ErrorCode::Usage, std::string(option) + ": '" + text.substr(0, 60) +
                                       "' is not of the form NAME:..., see --help"};
  return std::pair{text.substr(0, colon), text.substr(colon + 1)};
}

// `material`: a measured one, a .toml file, or a Young's modulus in Pa.
Status give(edit::Part part, const std::string& material, const char* option,
            edit::Editor& editor) {
  double young_modulus_pa = 0;
  const auto* end = material.data() + material.size();
  const auto parsed = std::from_chars(material.data(), end, young_modulus_pa);
  const auto given = [&]() -> Status {
    if (parsed.ec == std::errc{} && parsed.ptr == end) {
      if (!(young_modulus_pa >= 1 && young_modulus_pa <= material::kLargestModulus_pa))
        return Error{ErrorCode::Usage,
                     "Young's modulus is " + material + " Pa, allowed are 1 to 1e12"};
      return editor.use_neo_hookean(part, young_modulus_pa, kPoissonRatio);
    }
    const auto measured = material::measured_material(material);
    if (!measured) return measured.error();
    return editor.use_measured(part, *measured);
  }();
  if (given || given.error().message.starts_with("--")) return given;
  return Error{given.error().code, std::string(option) + ": " + given.error().message};
}

Status apply(const EditCommand& command, edit::Editor& editor) {
  for (const auto& text : command.releases) {
    const auto nodes = nodes_of(text, "--release", editor);
    if (!nodes) return nodes.error();
    editor.release(*nodes);
  }
  for (const auto& text : command.holds) {
    const auto nodes = nodes_of(text, "--hold", editor);
    if (!nodes) return nodes.error();
    editor.hold(*nodes);
  }
  for (const auto& text : command.regions) {
    const auto parts = named(text, "--region");
    if (!parts) return parts.error();
    const auto nodes = nodes_of(parts->second, "--region", editor);
    if (!nodes) return nodes.error();
    if (auto added = editor.add_region(parts->first, *nodes); !added)
      return Error{added.error().code, "--region: " + added.error().message};
  }
  if (!command.material.empty())
    if (auto given = give({}, command.material, "--material", editor); !given) return given;
  for (const auto& text : command.gives) {
    const auto parts = named(text, "--give");
    if (!parts) return parts.error();
    const auto& regions = editor.organ().regions;
    const auto region = std::ranges::find(regions, parts->first, &material::MaterialRegion::name);
    if (region == regions.end())
      return Error{ErrorCode::Usage,
                   "--give: the organ has no region '" + parts->first.substr(0, 60) + "'"};
    const auto number = static_cast<std::size_t>(region - regions.begin());
    if (auto given = give(number, parts->second, "--give", editor); !given) return given;
  }
  return {};
}

}  // namespace

void add_options(CLI::App& app, EditCommand& command) {
  app.add_option("ORGAN", command.organ,
                 "a built-in organ's name, an .organ file, or a mesh, surface or label map as "
                 "import reads it")
      ->required();
  app.add_option("--out", command.out,
                 "the file that is offered, or with --headless written [<organ>.organ, or a name "
                 "that is free]")
      ->type_name("FILE");
  app.add_option("--unit", command.unit, "length unit of a mesh or surface: m, cm or mm [m]")
      ->type_name("UNIT");
  app.add_option("--nodes", command.nodes,
                 "of a surface or a label map: how many nodes its mesh has [2000]")
      ->type_name("N");
  app.add_option("--labels", command.labels,
                 "of a label map: which make the organ, such as 1:liver,2:tumour [all but 0]")
      ->type_name("LIST");
  app.add_option("--release", command.releases,
                 "hold these nodes no more: terms such as x=-10..20, y=..-40 and surface with "
                 "commas between them, in mm from the organ's centre, or all")
      ->type_name("RULE")
      ->allow_extra_args(false);
  app.add_option("--hold", command.holds, "hold these nodes, after --release")
      ->type_name("RULE")
      ->allow_extra_args(false);
  app.add_option("--region", command.regions, "a new region of these nodes")
      ->type_name("NAME:RULE")
      ->allow_extra_args(false);
  app.add_option("--material", command.material,
                 "what the organ is made of: " + material::measured_material_names() +
                     ", a .toml file as identify leaves it, or a Young's modulus in Pa")
      ->type_name("MATERIAL");
  app.add_option("--give", command.gives, "what a region is made of, likewise")
      ->type_name("NAME:MATERIAL")
      ->allow_extra_args(false);
  app.add_flag("--headless", command.is_headless, "without a window: edit, save, end");
  app.add_flag("--replace", command.replaces, "with --headless: --out may be there already");
  app.add_option("--size", command.size, "of the window, pixels")
      ->type_name("WxH")
      ->capture_default_str();
  app.add_option("--scale", command.scale, "of words and panels [as the monitor says]")
      ->type_name("S")
      ->check(command_line::from_to(0.75, 3));
}

Result<std::pair<int, int>> window_size(const EditCommand& command) {
  return parse_size(command.size, 640, 400);
}

Result<edit::Editor> open(const EditCommand& command) {
  auto organ = read(command);
  if (!organ) return organ.error();
  edit::Editor editor(std::move(*organ));
  if (auto applied = apply(command, editor); !applied) return applied.error();
  return editor;
}

Result<std::string> save(const EditCommand& command, const edit::Editor& editor) {
  const auto path = command.out.empty() ? edit::free_name(command.organ).string() : command.out;
  const auto saved = edit::save(editor.organ(), path,
                                command.replaces ? edit::Replace::Allow : edit::Replace::Refuse);
  if (saved) return path;
  const auto& error = saved.error();
  // Nobody is there to be asked.
  if (error.code == ErrorCode::Refused)
    return Error{ErrorCode::Usage, error.message + ", or say --replace"};
  return error;
}

}  // namespace trocar::edit_command
