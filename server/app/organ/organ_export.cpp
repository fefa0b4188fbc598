#include "server/app/organ/organ_export.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <utility>

#include "common/base/text_file.h"
#include "common/image/image.h"
#include "common/wire/fine_surface.h"
#include "server/app/organ/organ_print.h"
#include "server/app/organ/program_name.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/formats/mesh_writer.h"
#include "server/organs/picture/organ_picture.h"

namespace trocar::app {

void add_export_command(CLI::App& app, ExportCommand& command) {
  auto* sub = app.add_subcommand("export", "write an organ's mesh for other programs");
  sub->add_option("ORGAN", command.organ, ".organ file, or what inspect takes")->required();
  sub->add_option("--out", command.out,
                  "file to write: .msh (Gmsh 2.2) and .vtu with tets, regions and held nodes; .stl "
                  "and .glb with the surface, .glb with the fine one where there is one")
      ->type_name("FILE")
      ->required();
  sub->add_option("--unit", command.unit, "length unit of the file: m, cm or mm; GLB is in m")
      ->type_name("UNIT")
      ->capture_default_str();
}

namespace {

formats::GlbSurface fine_surface_of(const organ::Organ& organ) {
  const wire::FineSurface& fine = organ.fine_surface;
  formats::GlbSurface surface;
  surface.name = organ.name;
  for (std::size_t v = 0; v < fine.quanta.size(); ++v)
    surface.positions.push_back(fine.position_m(v));
  for (const auto& [u, v] : fine.texture)
    surface.texture.push_back({static_cast<float>(u * wire::kTextureQuantum),
                               static_cast<float>(v * wire::kTextureQuantum)});
  surface.triangles = fine.triangles;
  surface.picture = fine.picture;
  return surface;
}

// Numbers of STL have 24 bits: far from the origin, vertices beside each other become one.
bool is_too_far_for_stl(const organ::Organ& organ) {
  const auto& mesh = organ.mesh;
  double farthest = 0, shortest = INFINITY;
  for (const Vec3d& p : mesh.rest_positions)
    farthest = std::max(farthest, length(p + organ.source_offset_m));
  for (const auto& [a, b, c] : mesh.boundary_triangles)
    for (const auto& [from, to] : {std::pair(a, b), {b, c}, {c, a}})
      shortest = std::min(shortest,
                          length(mesh.rest_positions[to.value] - mesh.rest_positions[from.value]));
  return farthest * 0x1p-23 > 0.01 * shortest;
}

}  // namespace

Status run_export(const ExportCommand& command) {
  const auto unit = mesh::parse_unit(command.unit);
  if (!unit) return unit.error();
  const auto ending = std::filesystem::path(command.out).extension();
  const bool has_tets = ending == ".msh" || ending == ".vtu";
  if (!has_tets && ending != ".stl" && ending != ".glb")
    return Error{ErrorCode::Usage,
                 "--out: " + command.out + ": the file must end with .msh, .vtu, .stl or .glb"};
  if (ending == ".glb" && *unit != mesh::Unit::Metre)
    return Error{ErrorCode::Usage, "--unit: " + command.out + ": .glb is in m"};
  const auto organ = catalogue::load_organ(command.organ);
  if (!organ) return organ.error();
  std::error_code ignored;
  if (std::filesystem::exists(command.out, ignored) &&
      organ->source.starts_with(std::filesystem::path(command.out).filename().string() + ","))
    return Error{ErrorCode::Usage, "--out: " + command.out +
                                       ": the organ was made from a file of this name, which "
                                       "would be lost: choose another name"};
  if (has_tets && organ->mesh.tets.empty())
    return Error{ErrorCode::Usage, command.organ + ": has no tetrahedra, only .stl and .glb apply"};
  if (ending == ".stl" && is_too_far_for_stl(*organ))
    return Error{ErrorCode::Usage,
                 "--out: " + command.out + ": " + command.organ +
                     " lies so far from its file's origin that the numbers of .stl are too short "
                     "for it: write .msh, .vtu or .glb"};
  formats::WrittenMesh written{.mesh = organ->mesh,
                               .name = organ->name,
                               .offset_m = organ->source_offset_m,
                               .unit = *unit,
                               .tet_regions = organ::material_map(*organ).tets,
                               .region_names = {organ->name},
                               .held_nodes = organ->fixed_nodes};
  for (const auto& region : organ->regions) written.region_names.push_back(region.name);
  const auto text = ending == ".msh"              ? formats::to_gmsh(written)
                    : ending == ".vtu"            ? formats::to_vtu(written)
                    : ending == ".stl"            ? formats::to_stl(written)
                    : organ->fine_surface.empty() ? formats::to_glb(written)
                                                  : formats::to_glb(fine_surface_of(*organ));
  if (auto status = write_text_file(command.out, text); !status) return status;
  std::printf("%s: %s bytes\n", command.out.c_str(), grouped(text.size()).c_str());
  return {};
}

Status draw(const organ::Organ& organ, const std::string& path) {
  std::vector<std::uint8_t> is_held(organ.mesh.node_count(), 0);
  for (const NodeIndex node : organ.fixed_nodes) is_held[node.value] = 1;
  const auto& fine = organ.fine_surface;
  image::Image painted;
  if (!fine.picture.empty()) {
    auto image = image::decode(fine.picture);
    if (image)
      painted = std::move(*image);
    else
      std::fprintf(stderr, "%s: warning: %s: the fine surface's %s\n", kProgram, organ.name.c_str(),
                   image.error().message.c_str());
  }
  const auto picture =
      picture::draw_organ(organ.mesh, organ::material_map(organ).nodes, is_held, fine, painted);
  const auto png = image::encode_png(picture.width, picture.height, picture.rgb());
  if (!png) return png.error();
  if (auto status = write_text_file(path, *png); !status) return status;
  std::fprintf(stderr, "%s: seen from the front, the left and above; the bar is %.3g mm long\n",
               path.c_str(), 1e3 * picture::scale_bar_m(organ.mesh));
  return {};
}

}  // namespace trocar::app
