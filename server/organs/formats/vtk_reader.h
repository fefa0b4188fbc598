#pragma once

// Reader of VTK's legacy format, as text or binary: unstructured grids of tetrahedra (versions 1 to
// 5.1) and polygonal surfaces. Cell data named region, label, material or alike number the regions.
// Other data are read over. Errors are one line with the line, or the byte once there were bytes.
//
// Source: The VTK User's Guide, chapter "VTK File Formats".

#include <string>
#include <string_view>
#include <variant>

#include "common/base/result.h"
#include "server/organs/mesh/raw_tets.h"
#include "server/organs/surface/raw_surface.h"

namespace trocar::formats {

using TetsOrSurface = std::variant<mesh::RawTets, surface::RawSurface>;

Result<TetsOrSurface> parse_vtk(std::string_view text, const std::string& name);

}  // namespace trocar::formats
