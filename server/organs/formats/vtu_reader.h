#pragma once

// Reader of VTK's XML format for unstructured grids (.vtu): one piece of tetrahedra, numbers as
// text, base64 or appended bytes, packed by zlib or not, little-endian. Cell data named region,
// label, material or alike number the regions. Errors are one line with the line of the element.

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "server/organs/mesh/raw_tets.h"

namespace trocar::formats {

Result<mesh::RawTets> parse_vtu(std::string_view text, const std::string& name);

}  // namespace trocar::formats
