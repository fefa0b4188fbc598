#pragma once

// glTF 2.0 in one binary file (.glb): the triangles of all meshes of its scene as one surface, each
// moved as its node says.
//
// Read are positions, indices, and places in a picture: those of the materials' base colour, or
// TEXCOORD_0 where no material has a picture. The picture is the file's own, a PNG or JPEG file;
// all materials share one. Lengths are in m, as the format says. Points and lines are left out.
//
// Refused, in one line with the place in the file: strips and fans, skins, sparse accessors,
// buffers outside the file, and what needs an extension. No more is built than 16 times the file's
// size and 16 MiB, of the JSON as of the triangles; the JSON itself may have 4 MiB.
//
// Source: Khronos Group, glTF 2.0 specification, 2021 (ISO/IEC 12113), 3.5 to 3.9 and 4.

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "server/organs/surface/raw_surface.h"

namespace trocar::formats {

Result<surface::RawSurface> parse_glb(std::string_view bytes, const std::string& name);

}  // namespace trocar::formats
