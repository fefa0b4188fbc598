#pragma once

// Reader of PLY surfaces, as text or binary of either byte order: x, y and z of the vertices and
// the corners of the faces; other properties and elements are read over.
//
// Source: Turk: The PLY polygon file format, 1994.

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "server/organs/surface/raw_surface.h"

namespace trocar::formats {

Result<surface::RawSurface> parse_ply(std::string_view text, const std::string& name);

}  // namespace trocar::formats
