#pragma once

// Cells of VTK's formats, legacy and XML: what becomes of points, lists of corners and types.
//
// Source: The VTK User's Guide, chapter "VTK File Formats".

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/math/vec3.h"
#include "server/organs/mesh/raw_tets.h"

namespace trocar::formats {

struct VtkCells {
  std::vector<Vec3d> points;
  std::vector<std::int64_t> corners;  // of all cells, one after the other
  std::vector<std::int64_t> ends;     // of each cell in `corners`, ascending
  std::vector<std::int64_t> types;    // one a cell
  std::vector<std::int64_t> regions;  // one a cell, or empty
  std::vector<std::string> left_out;  // data, such as "point data 'heat'"
};

// Whether cell data of that name number the regions of a mesh.
bool is_region_name(std::string_view name);

// Numbers of cells that are stored as fractions, if all of them are whole: else they are left out.
void take_regions(const std::vector<double>& numbers, const std::string& data, VtkCells& cells);
// The line for data that are left out; empty without.
std::string left_out_line(const std::vector<std::string>& data);

// Tetrahedra of the cells; vertices, lines and triangles are skipped. Errors name the cell, counted
// from 0 as VTK does, and begin with `name`.
Result<mesh::RawTets> tets_of(VtkCells cells, const std::string& name);

}  // namespace trocar::formats
