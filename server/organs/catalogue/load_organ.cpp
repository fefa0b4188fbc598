#include "server/organs/catalogue/load_organ.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/base/log.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/mesh/gmsh_reader.h"
#include "server/organs/organ/organ_file.h"

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

}  // namespace

Result<ImportedOrgan> import_organ(const std::filesystem::path& path,
                                   const ImportOptions& options) {
  if (path.extension() != ".msh")
    return Error{ErrorCode::BadFile, path.string() +
                                         ": only .msh files (Gmsh 2.2 ASCII) can be "
                                         "imported"};
  auto imported = mesh::read_gmsh(path, options.unit);
  if (!imported) return imported.error();
  ImportedOrgan result{{}, std::move(imported->warnings)};
  organ::Organ& organ = result.organ;
  organ.name = plain(options.name.value_or(path.stem().string()));
  organ.source = plain(path.filename().string()) + ", unit " + name_of(options.unit) + ", fix " +
                 to_text(options.fix);
  organ.mesh = std::move(imported->mesh);
  if (auto warning = size_warning(organ.mesh, options.unit); !warning.empty())
    result.warnings.push_back(std::move(warning));
  organ.source_offset_m = imported->offset_m;
  organ.fixed_nodes = organ::nodes_held_by(options.fix, organ.mesh);
  organ.node_masses_kg = organ::lumped_masses(organ);
  if (auto status = validate(organ); !status)
    return Error{ErrorCode::BadFile, path.string() + ": " + status.error().message};
  return result;
}

Result<organ::Organ> load_organ(const std::string& spec) {
  if (spec == "liver") return make_measured_liver();
  if (spec == "elastic-liver") return make_liver();
  if (spec == "lattice") return make_lattice();
  if (spec == "plate") return make_plate();
  if (spec == "stomach") return make_stomach();
  if (spec == "chest") return make_chest();
  const std::filesystem::path path(spec);
  if (path.extension() == ".organ") return organ::read_organ(path);
  if (path.extension() == ".msh") {
    auto imported = import_organ(path, {});
    if (!imported) return imported.error();
    for (const std::string& warning : imported->warnings) log::warn("{}: {}", spec, warning);
    return std::move(imported->organ);
  }
  return Error{ErrorCode::BadFile,
               "organ '" + spec +
                   "' is neither liver, elastic-liver, lattice, plate, stomach nor chest, nor an "
                   ".organ or .msh file"};
}

}  // namespace trocar::catalogue
