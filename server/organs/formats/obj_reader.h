#pragma once

// Reader of the vertices and faces of Wavefront OBJ surfaces. Faces of more than three corners are
// split around their first one. Materials, groups, normals and texture coordinates are read over;
// free-form curves and surfaces are refused.
//
// Source: Wavefront Advanced Visualizer manual, appendix B1.

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "server/organs/surface/raw_surface.h"

namespace trocar::formats {

Result<surface::RawSurface> parse_obj(std::string_view text, const std::string& name);

}  // namespace trocar::formats
