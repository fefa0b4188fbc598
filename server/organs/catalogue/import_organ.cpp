#include "server/organs/catalogue/import_organ.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <set>
#include <variant>

#include "common/base/printable.h"
#include "server/organs/formats/mesh_file.h"
#include "server/organs/formats/text_reader.h"
#include "server/organs/label_map/label_mesh.h"
#include "server/organs/label_map/nifti_reader.h"
#include "server/organs/mesh/fill_field.h"
#include "server/organs/surface/closed_surface.h"
#include "server/organs/surface/signed_distance.h"

namespace trocar::catalogue {
namespace {

std::string own_name(std::string_view name) {
  return as_name(name, organ::kMostNameBytes);
}

// Names for what a file names, and which of them became others.
class Naming {
 public:
  // Returns the name as an organ may have it.
  std::string own(const std::string& name) {
    auto own = own_name(name);
    if (own.empty()) own = "unnamed";
    if (own != name) add(kept_.empty() ? "" : ", ", printable(name, 60), own, kept_);
    return own;
  }
  // Gives each a name of its own.
  void name(std::vector<mesh::NamedNodes>& sets) {
    std::set<std::string> taken;
    for (auto& set : sets) taken.insert(set.name = own(set.name));
    std::map<std::string, int> count;  // of each name so far
    for (auto& set : sets) {
      const std::string name = set.name;
      int& nth = count[name];
      ++nth;
      if (nth == 1) continue;
      const auto numbered = [&] { return fmt::format("{}-{}", as_name(name, 180), nth); };
      while (taken.contains(numbered())) ++nth;
      set.name = numbered();
      taken.insert(set.name);
      add(shared_.empty() ? "the next " : ", the next ", name, set.name, shared_);
    }
  }
  // what: all of them, such as "regions".
  void say(const char* what, std::vector<std::string>& warnings) const {
    if (!kept_.empty())
      warnings.push_back(fmt::format("names of {} must be 1 to {} bytes of printable UTF-8, so {}",
                                     what, organ::kMostNameBytes, kept_));
    if (!shared_.empty()) warnings.push_back(fmt::format("{} share a name, so {}", what, shared_));
  }

 private:
  static void add(const char* before, const std::string& name, const std::string& own,
                  std::string& list) {
    if (list.size() < 200)
      list += fmt::format("{}'{}' is '{}' here", before, name, own);
    else if (!list.ends_with("..."))
      list += ", ...";
  }

  std::string kept_, shared_;
};

const char* name_of(mesh::Unit unit) {
  return unit == mesh::Unit::Metre ? "m" : unit == mesh::Unit::Centimetre ? "cm" : "mm";
}

// A tool's tip is 10 mm thick: what is smaller than that in every direction is hardly an organ.
constexpr double kSmallestOrgan_m = 0.010;

// Empty if the size is plausible; else one line with the size and what to do. An organ that is too
// large is refused by the reader of meshes.
std::string size_warning(const mesh::TetMesh& mesh, mesh::Unit unit) {
  Vec3d half{};  // the box around the organ is centred on the origin
  for (const Vec3d& p : mesh.rest_positions)
    half = {std::max(half.x, p.x), std::max(half.y, p.y), std::max(half.z, p.z)};
  const double largest_m = 2 * std::max({half.x, half.y, half.z});
  if (largest_m >= kSmallestOrgan_m) return {};
  std::string text =
      fmt::format("the organ is only {:.3g} x {:.3g} x {:.3g} mm with --unit {}: ", 2e3 * half.x,
                  2e3 * half.y, 2e3 * half.z, name_of(unit));
  const double in_file = largest_m / metres_of(unit);
  for (const auto other : {mesh::Unit::Metre, mesh::Unit::Centimetre})
    if (const double m = in_file * metres_of(other); m >= kSmallestOrgan_m && m <= 2)
      return text + fmt::format("with trocar-organ import --unit {} it would be {:.3g} mm long",
                                name_of(other), 1e3 * m);
  return text + "check the unit of the file";
}

mesh::Box box_around(const std::vector<Vec3d>& positions) {
  mesh::Box box;
  for (const Vec3d& p : positions) box.include(p);
  return box;
}

Result<int> nodes_of(const ImportOptions& options) {
  const int nodes = options.nodes.value_or(kDefaultFillNodes);
  if (nodes < mesh::kMinFillNodes || nodes > mesh::kMaxFillNodes)
    return Error{ErrorCode::Usage, fmt::format("--nodes: {} must be {} to {}", nodes,
                                               mesh::kMinFillNodes, mesh::kMaxFillNodes)};
  return nodes;
}

using Labels = std::vector<std::pair<std::uint16_t, std::string>>;

// Error: a number or a name is there twice.
Status check_distinct(const Labels& labels) {
  std::set<std::uint16_t> numbers;
  std::map<std::string, std::uint16_t> names;
  for (const auto& [label, name] : labels) {
    if (!numbers.insert(label).second)
      return Error{ErrorCode::Usage,
                   fmt::format("--labels: label {} is there twice: say it once", label)};
    const auto [other, is_new] = names.try_emplace(name, label);
    if (!is_new)
      return Error{ErrorCode::Usage,
                   fmt::format("--labels: {} and {} are both named '{}': say another name, such as "
                               "{}:NAME",
                               other->second, label, name, label)};
  }
  return {};
}

// The labels that are wanted, with the numbers and names that the map gives them.
Result<Labels> find_labels(const Labels& wanted, const Labels& there, const std::string& file) {
  Labels labels;
  for (const auto& want : wanted.empty() ? there : wanted) {
    const auto& [label, name] = want;
    const auto is_named_so = [&want](const auto& one) { return one.second == want.second; };
    const auto known = std::ranges::find_if(there, [&](const auto& one) {
      return want.first == 0 ? is_named_so(one) : one.first == want.first;
    });
    if (label == 0 && known == there.end()) {
      std::string text;
      for (const auto& [number, known_name] : there)
        text += fmt::format("{} {}:{}", text.empty() ? "" : ",", number, known_name);
      return Error{ErrorCode::Usage, fmt::format("--labels: {} has no label '{}', {}", file, name,
                                                 there.empty() ? "and names none: choose by number"
                                                               : "it has" + text)};
    }
    if (label == 0 && std::ranges::count_if(there, is_named_so) > 1)
      return Error{ErrorCode::Usage, fmt::format("--labels: {} has more than one label '{}': "
                                                 "choose by number, such as {}:NAME",
                                                 file, name, known->first)};
    const bool has_name = known != there.end() && name.empty();
    labels.emplace_back(label == 0 ? known->first : label, has_name ? known->second
                                                           : name.empty()
                                                               ? fmt::format("label {}", label)
                                                               : name);
  }
  // Names that the map itself gives twice are told apart later.
  if (wanted.empty()) return labels;
  if (auto s = check_distinct(labels); !s) return s.error();
  return labels;
}

Result<mesh::ImportedMesh> fill_labels(label_map::LabelMap map, const std::string& file,
                                       const ImportOptions& options,
                                       std::vector<std::string>& notes) {
  const auto nodes = nodes_of(options);
  if (!nodes) return nodes.error();
  const auto labels = find_labels(options.labels, map.names, file);
  if (!labels) return labels.error();
  std::vector<std::uint16_t> numbers;
  if (!options.labels.empty())
    for (const auto& [label, name] : *labels) numbers.push_back(label);
  const auto solid = label_map::LabelSolid::make(std::move(map), numbers, file);
  if (!solid) return solid.error();
  if (solid->labels().size() > organ::kMaxRegions)
    return Error{ErrorCode::BadFile,
                 fmt::format("{}: has {} labels, an organ may have {}: choose some (--labels)",
                             file, solid->labels().size(), organ::kMaxRegions)};
  auto filled = label_map::mesh_labels(*solid, *nodes, *labels, file);
  if (!filled) return filled.error();
  notes = std::move(filled->notes);
  return std::move(filled->imported);
}

// Fills a surface; the notes say with what, and how well it fits.
Result<mesh::ImportedMesh> fill(surface::RawSurface raw, const ImportOptions& options,
                                const std::string& name, std::vector<std::string>& notes) {
  const auto nodes = nodes_of(options);
  if (!nodes) return nodes.error();
  auto left_out = std::move(raw.left_out);
  auto solid = surface::check_surface(std::move(raw), options.unit, name);
  if (!solid) return solid.error();
  const surface::SignedDistance distance(*solid);
  auto filled =
      mesh::fill_field([&](const Vec3d& p) { return distance(p); }, box_around(solid->positions),
                       solid->volume_m3, solid->area_m2, *nodes);
  if (!filled) return Error{ErrorCode::BadFile, name + ": " + filled.error().message};
  mesh::ImportedMesh imported{
      std::move(filled->mesh), solid->offset_m, std::move(solid->warnings), {}, {},
      std::move(left_out)};
  imported.offset_m += centre_on_origin(imported.mesh);
  const double volume = total_volume(imported.mesh);
  const auto angles = dihedral_range(imported.mesh);
  notes.push_back(fmt::format(
      "filled {} triangles{} with {} nodes and {} tets, spacing {:.2f} mm", solid->triangles.size(),
      solid->cavities == 0 ? "" : fmt::format(" and {} cavities", solid->cavities),
      imported.mesh.node_count(), imported.mesh.tets.size(), 1e3 * filled->spacing_m));
  notes.push_back(fmt::format(
      "volume {:.4g} ml, {:+.2f} % of the surface's {:.4g} ml; dihedral angles {:.1f} to {:.1f} "
      "degrees",
      1e6 * volume, 100 * (volume / solid->volume_m3 - 1), 1e6 * solid->volume_m3, angles.min_deg,
      angles.max_deg));
  return imported;
}

Result<mesh::ImportedMesh> read_mesh(const std::filesystem::path& path,
                                     const ImportOptions& options, ImportedOrgan& result) {
  const std::string name = path.string();
  if (!options.labels.empty())
    return Error{ErrorCode::Usage, name + ": --labels does not apply, the file is no label map"};
  if (!formats::is_mesh_file(path))
    return Error{ErrorCode::BadFile, name + ": is of no kind that can be imported: " +
                                         formats::kMeshEndings + ", .nii, .nii.gz"};
  auto file = formats::read_mesh_file(path);
  if (!file) return file.error();
  if (auto* surface = std::get_if<surface::RawSurface>(&*file)) {
    result.axes = surface->axes;
    return fill(std::move(*surface), options, name, result.notes);
  }
  if (options.nodes)
    return Error{ErrorCode::Usage, name + ": --nodes does not apply, the file has tetrahedra"};
  return mesh::make_mesh(std::get<mesh::RawTets>(std::move(*file)), options.unit, name);
}

std::string names_of(const std::vector<mesh::NamedNodes>& sets) {
  std::string text;
  for (const auto& set : sets) {
    if (text.size() > 200) return text + ", ...";
    text += (text.empty() ? "" : ", ") + set.name;
  }
  return text;
}

// Regions of the organ's own material, for others to be given. They say their tets only where
// others than those would be in them by their nodes.
void add_regions(std::vector<mesh::NamedNodes> regions, ImportedOrgan& result) {
  if (regions.empty()) return;
  result.notes.push_back("regions: " + names_of(regions));
  organ::Organ& organ = result.organ;
  for (const auto& region : regions)
    organ.regions.push_back({region.name, organ.material, region.nodes, {}});
  const auto by_nodes = organ::material_map(organ).tets;
  for (std::size_t r = 0; r < regions.size(); ++r)
    organ.regions[r].tets = std::move(regions[r].tets);
  if (organ::material_map(organ).tets == by_nodes)
    for (auto& region : organ.regions) region.tets.clear();
}

Status hold(const ImportOptions& options, const std::vector<mesh::NamedNodes>& sets,
            ImportedOrgan& result) {
  if (!sets.empty()) result.notes.push_back("sets of nodes: " + names_of(sets));
  if (!options.fix_set) {
    result.organ.fixed_nodes = organ::nodes_held_by(options.fix, result.organ.mesh);
    return {};
  }
  const std::string name = own_name(*options.fix_set);
  auto set = std::ranges::find(sets, name, &mesh::NamedNodes::name);
  if (set == sets.end())
    set = std::ranges::find(sets, formats::lower(name),
                            [](const auto& one) { return formats::lower(one.name); });
  if (set == sets.end())
    return Error{ErrorCode::Usage,
                 "--fix: the file has no set '" + name +
                     (sets.empty() ? "', it has none" : "', it has: " + names_of(sets))};
  result.organ.fixed_nodes = set->nodes;
  return {};
}

// has_unit: the file's numbers were in options.unit.
Result<ImportedOrgan> make_organ(mesh::ImportedMesh imported, const std::filesystem::path& path,
                                 const ImportOptions& options, bool has_unit,
                                 ImportedOrgan result) {
  result.warnings = std::move(imported.warnings);
  organ::Organ& organ = result.organ;
  Naming of_organ, of_regions, of_sets;
  organ.name = of_organ.own(options.name.value_or(imported_name(path)));
  of_organ.say("organs", result.warnings);
  organ.source = own_name(path.filename().string()) +
                 (has_unit ? std::string(", unit ") + name_of(options.unit) : "") + ", fix " +
                 (options.fix_set ? "set:" + own_name(*options.fix_set) : to_text(options.fix));
  organ.mesh = std::move(imported.mesh);
  if (auto warning = size_warning(organ.mesh, options.unit); !warning.empty())
    result.warnings.push_back(std::move(warning));
  organ.source_offset_m = imported.offset_m;
  of_regions.name(imported.regions);
  of_regions.say("regions", result.warnings);
  of_sets.name(imported.node_sets);
  of_sets.say("sets of nodes", result.warnings);
  add_regions(std::move(imported.regions), result);
  if (auto s = hold(options, imported.node_sets, result); !s) return s.error();
  std::ranges::move(imported.left_out, std::back_inserter(result.warnings));
  organ.node_masses_kg = organ::lumped_masses(organ);
  if (auto status = validate(organ); !status)
    return Error{ErrorCode::BadFile, path.string() + ": " + status.error().message};
  return result;
}

}  // namespace

std::string imported_name(const std::filesystem::path& path) {
  const auto stem = path.stem();
  return (stem.extension() == ".nii" ? stem.stem() : stem).string();
}

bool can_be_imported(const std::filesystem::path& path) {
  return formats::is_mesh_file(path) || label_map::is_nifti_file(path);
}

Result<std::vector<std::pair<std::uint16_t, std::string>>> parse_labels(std::string_view text) {
  std::vector<std::pair<std::uint16_t, std::string>> labels;
  while (!text.empty()) {
    const auto comma = std::min(text.find(','), text.size());
    const auto part = text.substr(0, comma);
    text.remove_prefix(std::min(comma + 1, text.size()));
    const auto colon = std::min(part.find(':'), part.size());
    // A name alone: the map says its number.
    if (colon == part.size() && !part.empty() && (part[0] < '0' || part[0] > '9')) {
      labels.emplace_back(std::uint16_t{0}, own_name(part));
      continue;
    }
    if (colon + 1 == part.size())
      return Error{
          ErrorCode::Usage,
          fmt::format("--labels: '{}' has no name behind its colon: say one, or the number "
                      "alone",
                      own_name(part))};
    int label = 0;
    const auto [end, error] = std::from_chars(part.data(), part.data() + colon, label);
    if (error != std::errc{} || end != part.data() + colon || label < 1 || label > 65535)
      return Error{ErrorCode::Usage,
                   fmt::format("--labels: '{}' is no label, such as 2 or 2:tumour, from 1 to 65535",
                               own_name(part))};
    labels.emplace_back(static_cast<std::uint16_t>(label),
                        own_name(part.substr(std::min(colon + 1, part.size()))));
  }
  return labels;
}

Result<ImportedOrgan> import_labels(label_map::LabelMap map, const std::filesystem::path& path,
                                    const ImportOptions& options) {
  ImportedOrgan result;
  result.unit_m = map.unit_m;
  result.axes = surface::Axes::LeftHeadFront;
  Naming naming;
  std::erase_if(map.names, [](const auto& one) { return one.second.empty(); });
  for (auto& [label, name] : map.names) name = naming.own(name);
  auto imported = fill_labels(std::move(map), path.string(), options, result.notes);
  if (!imported) return imported.error();
  naming.say("labels", imported->warnings);
  return make_organ(std::move(*imported), path, options, options.unit_is_said, std::move(result));
}

Result<ImportedOrgan> import_organ(const std::filesystem::path& path,
                                   const ImportOptions& options) {
  if (label_map::is_nifti_file(path)) {
    auto map = label_map::read_nifti(
        path, options.unit_is_said ? std::optional(options.unit) : std::nullopt);
    return map ? import_labels(std::move(*map), path, options) : map.error();
  }
  ImportedOrgan result;
  result.unit_m = metres_of(options.unit);
  auto imported = read_mesh(path, options, result);
  if (!imported) return imported.error();
  return make_organ(std::move(*imported), path, options, true, std::move(result));
}

}  // namespace trocar::catalogue
