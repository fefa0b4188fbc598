#pragma once

// Reader of TetGen's meshes: a .node file with points and an .ele file with tetrahedra of four
// nodes. The first attribute of an element is its region. Numbers begin at 0 or 1, as the first
// point says.
//
// Source: Si: TetGen user's manual, chapter "File formats".

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "server/organs/mesh/raw_tets.h"

namespace trocar::formats {

Result<mesh::RawTets> parse_tetgen(std::string_view nodes, const std::string& nodes_name,
                                   std::string_view elements, const std::string& elements_name);

}  // namespace trocar::formats
