#pragma once

// Reader of STL surfaces, as text or binary (little-endian). Corners at exactly the same place are
// one vertex. Normals in the file are not used.
//
// Source: Burns: Automated Fabrication, 1993, section 6.5.

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "server/organs/surface/raw_surface.h"

namespace trocar::formats {

Result<surface::RawSurface> parse_stl(std::string_view text, const std::string& name);

}  // namespace trocar::formats
