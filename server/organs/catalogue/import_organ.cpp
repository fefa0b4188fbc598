#include "server/organs/catalogue/import_organ.h"

#include <fmt/format.h>

#include <algorithm>
#include <variant>

#include "server/organs/formats/mesh_file.h"
#include "server/organs/mesh/fill_field.h"
#include "server/organs/surface/closed_surface.h"
#include "server/organs/surface/signed_distance.h"

namespace trocar::catalogue {
namespace {

// Names travel in messages and file headers, which must be plain text.
std::string plain(const std::string& text) {
  std::string out = text.substr(0, 200);
  for (char& c : out)
    if (c < 32 || c > 126) c = '_';
  return out.empty() ? "organ" : out;
}

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
  mesh::Box box{positions.front(), positions.front()};
  for (const Vec3d& p : positions) {
    box.low = {std::min(box.low.x, p.x), std::min(box.low.y, p.y), std::min(box.low.z, p.z)};
    box.high = {std::max(box.high.x, p.x), std::max(box.high.y, p.y), std::max(box.high.z, p.z)};
  }
  return box;
}

// Fills a surface; the notes say with what, and how well it fits.
Result<mesh::ImportedMesh> fill(surface::RawSurface raw, const ImportOptions& options,
                                const std::string& name, std::vector<std::string>& notes) {
  const int nodes = options.nodes.value_or(kDefaultFillNodes);
  if (nodes < mesh::kMinFillNodes || nodes > mesh::kMaxFillNodes)
    return Error{ErrorCode::Usage, fmt::format("--nodes: {} must be {} to {}", nodes,
                                               mesh::kMinFillNodes, mesh::kMaxFillNodes)};
  auto solid = surface::check_surface(std::move(raw), options.unit, name);
  if (!solid) return solid.error();
  const surface::SignedDistance distance(*solid);
  auto filled =
      mesh::fill_field([&](const Vec3d& p) { return distance(p); }, box_around(solid->positions),
                       solid->volume_m3, solid->area_m2, nodes);
  if (!filled) return Error{ErrorCode::BadFile, name + ": " + filled.error().message};
  mesh::ImportedMesh imported{
      std::move(filled->mesh), solid->offset_m, std::move(solid->warnings), {}, {}};
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

std::string names_of(const std::vector<mesh::NamedNodes>& sets) {
  std::string text;
  for (const auto& set : sets) {
    if (text.size() > 200) return text + ", ...";
    text += (text.empty() ? "" : ", ") + set.name;
  }
  return text;
}

// Regions of the organ's own material, for others to be given; an element belongs to the last
// region that holds all of its nodes.
Status add_regions(std::vector<mesh::NamedNodes> regions, ImportedOrgan& result) {
  if (regions.empty()) return {};
  result.notes.push_back(
      fmt::format("has {} regions: {}", regions.size(), plain(names_of(regions))));
  for (auto& region : regions)
    result.organ.regions.push_back(
        {plain(region.name), result.organ.material, std::move(region.nodes)});
  return {};
}

Status hold(const ImportOptions& options, const std::vector<mesh::NamedNodes>& sets,
            ImportedOrgan& result) {
  if (!sets.empty())
    result.notes.push_back(
        fmt::format("has {} sets of nodes: {}", sets.size(), plain(names_of(sets))));
  if (!options.fix_set) {
    result.organ.fixed_nodes = organ::nodes_held_by(options.fix, result.organ.mesh);
    return {};
  }
  const auto set = std::ranges::find(sets, *options.fix_set, &mesh::NamedNodes::name);
  if (set == sets.end())
    return Error{ErrorCode::Usage,
                 "--fix: the file has no set '" + plain(*options.fix_set) +
                     (sets.empty() ? "', it has none" : "', it has: " + plain(names_of(sets)))};
  result.organ.fixed_nodes = set->nodes;
  return {};
}

}  // namespace

Result<ImportedOrgan> import_organ(const std::filesystem::path& path,
                                   const ImportOptions& options) {
  const std::string name = path.string();
  if (!formats::is_mesh_file(path))
    return Error{ErrorCode::BadFile,
                 name + ": is of no kind that can be imported: " + formats::kMeshEndings};
  auto file = formats::read_mesh_file(path);
  if (!file) return file.error();
  ImportedOrgan result;
  auto* surface = std::get_if<surface::RawSurface>(&*file);
  if (!surface && options.nodes)
    return Error{ErrorCode::Usage, name + ": --nodes does not apply, the file has tetrahedra"};
  auto imported =
      surface ? fill(std::move(*surface), options, name, result.notes)
              : mesh::make_mesh(std::move(std::get<mesh::RawTets>(*file)), options.unit, name);
  if (!imported) return imported.error();
  result.warnings = std::move(imported->warnings);
  organ::Organ& organ = result.organ;
  organ.name = plain(options.name.value_or(path.stem().string()));
  organ.source = plain(path.filename().string()) + ", unit " + name_of(options.unit) + ", fix " +
                 (options.fix_set ? "set:" + plain(*options.fix_set) : to_text(options.fix));
  organ.mesh = std::move(imported->mesh);
  if (auto warning = size_warning(organ.mesh, options.unit); !warning.empty())
    result.warnings.push_back(std::move(warning));
  organ.source_offset_m = imported->offset_m;
  if (auto s = add_regions(std::move(imported->regions), result); !s) return s.error();
  if (auto s = hold(options, imported->node_sets, result); !s) return s.error();
  organ.node_masses_kg = organ::lumped_masses(organ);
  if (auto status = validate(organ); !status)
    return Error{ErrorCode::BadFile, name + ": " + status.error().message};
  return result;
}

}  // namespace trocar::catalogue
