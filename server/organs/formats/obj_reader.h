#pragma once

// Reader of the vertices and faces of Wavefront OBJ surfaces. Faces of more than three corners are
// cut into triangles (polygon.h). Materials, groups and normals are read over. Texture coordinates
// that are wrong are left out, and RawSurface::texture_fault says so. Free-form curves and surfaces
// are refused.
//
// Source: Wavefront Advanced Visualizer manual, appendix B1.

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "server/organs/surface/raw_surface.h"

namespace trocar::formats {

Result<surface::RawSurface> parse_obj(std::string_view text, const std::string& name);

}  // namespace trocar::formats
