#include "server/app/organ/organ_embed.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <utility>
#include <variant>

#include "common/command_line/limits.h"
#include "server/app/organ/program_name.h"
#include "server/organs/embed/embed.h"
#include "server/organs/formats/mesh_file.h"
#include "server/organs/mesh/raw_tets.h"

namespace trocar::app {
namespace {

using surface::Axes;

const char* name_of(Axes axes) {
  return axes == Axes::Ras ? "RAS" : axes == Axes::Lps ? "LPS" : "left, head and front";
}

// Reads the names of --embed-frame that are of a patient's axes.
Axes axes_of(const std::string& frame) {
  return frame == "ras" ? Axes::Ras : frame == "lps" ? Axes::Lps : Axes::Unsaid;
}

// Sets axes and offset, and says where from they are; empty: they are those of the organ's file.
Result<std::string> choose_frame(const EmbedCommand& command, const EmbedPlace& place,
                                 const surface::RawSurface& raw, embed::EmbedOptions& options) {
  if (command.frame == "organ") {
    options.offset_m = {};
    return std::string("around the organ's centre, as --embed-frame says");
  }
  if (command.frame == "file") return std::string("in its own axes, as --embed-frame says");
  const Axes said = axes_of(command.frame), own = said != Axes::Unsaid ? said : raw.axes;
  options.axes = own != Axes::Unsaid ? own : place.axes;
  options.organ_axes = place.organ_axes;
  if (place.organ_axes == Axes::Unsaid && said != Axes::Unsaid) {
    options.organ_axes = Axes::LeftHeadFront;
  } else if (place.organ_axes == Axes::Unsaid) {
    // Every glTF file has the axes of its format: those alone say nothing about the other file.
    if (own == Axes::Unsaid || own == Axes::LeftHeadFront) return std::string();
    return Error{ErrorCode::Usage,
                 fmt::format("{}: says that its axes are {}, and {} does not say its own: with "
                             "--embed-frame file they are the same",
                             command.file, name_of(own), place.file)};
  }
  if (options.axes == options.organ_axes)
    return std::string(options.axes == Axes::LeftHeadFront
                           ? "x to the left, y to the head, z to the front, as glTF has them"
                           : "");
  return fmt::format("turned from {}, as {}", name_of(options.axes),
                     said != Axes::Unsaid  ? "--embed-frame says"
                     : own != Axes::Unsaid ? "the file says"
                                           : "the label map is");
}

std::string unit_text(double unit_m) {
  return unit_m == 1      ? "m"
         : unit_m == 1e-2 ? "cm"
         : unit_m == 1e-3 ? "mm"
                          : fmt::format("{} m", unit_m);
}

}  // namespace

void add_embed_options(CLI::App& app, EmbedCommand& command) {
  auto* embed = app.add_option(
      "--embed", command.file,
      "a fine surface that is drawn instead of the mesh's and is cut with it: .stl, "
      ".obj, .ply or .glb, in the unit and position of FILE; at most 200,000 triangles");
  embed->type_name("FINE");
  app.add_option("--embed-picture", command.picture,
                 "what is painted on it by its texture coordinates: .png or .jpg, at most 4 MiB "
                 "[that of a .glb]")
      ->type_name("FILE")
      ->needs(embed);
  app.add_option("--embed-frame", command.frame,
                 "its axes: file (as they are), ras or lps (a patient's, turned as a label map's), "
                 "organ (as export writes .glb); auto: what it says, or those of FILE")
      ->type_name("FRAME")
      ->needs(embed)
      ->check(command_line::one_of({"auto", "file", "ras", "lps", "organ"}))
      ->capture_default_str();
  app.add_option("--embed-unit", command.unit,
                 "length unit of the fine surface: m, cm or mm [.glb: m, else that of FILE]")
      ->type_name("UNIT")
      ->needs(embed)
      ->check(command_line::one_of({"m", "cm", "mm"}));
}

Status embed_surface(const EmbedCommand& command, const EmbedPlace& place, organ::Organ& organ) {
  if (command.file.empty()) return {};
  if (!formats::is_mesh_file(command.file))
    return Error{ErrorCode::BadFile,
                 command.file + ": is of no kind that --embed reads: " + formats::kSurfaceEndings};
  auto file = formats::read_mesh_file(command.file);
  if (!file) return file.error();
  const auto* raw = std::get_if<surface::RawSurface>(&*file);
  if (raw == nullptr)
    return Error{ErrorCode::BadFile, command.file + ": --embed needs a surface, it has tetrahedra"};
  embed::EmbedOptions options;
  options.unit_m = raw->unit_m.value_or(place.unit_m);
  options.offset_m = organ.source_offset_m;
  options.name = command.file;
  if (!command.unit.empty()) {
    const auto unit = mesh::parse_unit(command.unit);
    if (!unit) return unit.error();
    options.unit_m = mesh::metres_of(*unit);
  }
  const auto frame = choose_frame(command, place, *raw, options);
  if (!frame) return frame.error();
  if (!frame->empty() || options.unit_m != place.unit_m)
    std::fprintf(stderr, "%s: %s: read in %s%s%s\n", kProgram, command.file.c_str(),
                 unit_text(options.unit_m).c_str(), frame->empty() ? "" : ", ", frame->c_str());
  if (!command.picture.empty()) {
    auto picture = formats::read_foreign_file(command.picture);
    if (!picture) return picture.error();
    options.picture = std::move(*picture);
    options.picture_name = command.picture;
  } else {
    options.picture = raw->picture;
  }
  auto fine = embed::embed(*raw, organ.mesh, options);
  if (!fine) return fine.error();
  fine->warnings.insert(fine->warnings.begin(), raw->left_out.begin(), raw->left_out.end());
  for (const std::string& warning : fine->warnings)
    std::fprintf(stderr, "%s: warning: %s: %s\n", kProgram, command.file.c_str(), warning.c_str());
  std::fprintf(stderr,
               "%s: %s: fine surface of %zu triangles and %zu vertices, at most %.2f mm from the "
               "mesh's\n",
               kProgram, command.file.c_str(), fine->surface.triangles.size(),
               fine->surface.quanta.size(), 1e3 * fine->farthest_m);
  organ.fine_surface = std::move(fine->surface);
  return {};
}

}  // namespace trocar::app
