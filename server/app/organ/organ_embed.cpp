#include "server/app/organ/organ_embed.h"

#include <cstdio>
#include <utility>
#include <variant>

#include "server/app/organ/program_name.h"
#include "server/organs/embed/embed.h"
#include "server/organs/formats/mesh_file.h"

namespace trocar::app {

Status embed_surface(const EmbedCommand& command, organ::Organ& organ) {
  if (command.file.empty()) {
    if (command.picture.empty()) return {};
    return Error{ErrorCode::Usage, "--embed-picture: needs --embed, the surface it is painted on"};
  }
  auto file = formats::read_mesh_file(command.file);
  if (!file) return file.error();
  const auto* raw = std::get_if<surface::RawSurface>(&*file);
  if (raw == nullptr)
    return Error{ErrorCode::BadFile, command.file + ": --embed needs a surface, it has tetrahedra"};
  embed::EmbedOptions options{.unit_m = command.unit_m,
                              .offset_m = organ.source_offset_m,
                              .picture = {},
                              .name = command.file};
  if (!command.picture.empty()) {
    auto picture = formats::read_foreign_file(command.picture);
    if (!picture) return picture.error();
    options.picture = std::move(*picture);
  } else {
    options.picture = raw->picture;
  }
  auto fine = embed::embed(*raw, organ.mesh, options);
  if (!fine) return fine.error();
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
