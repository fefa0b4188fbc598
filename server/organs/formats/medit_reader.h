#pragma once

// Reader of MEDIT's text format (.mesh): vertices and tetrahedra; the reference of a tetrahedron is
// its region. Vertices, edges and triangles of one reference become a set of nodes of that number;
// other lists are read over.
//
// Source: Frey: MEDIT, an interactive mesh visualization software, INRIA RT-0253.

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "server/organs/mesh/raw_tets.h"

namespace trocar::formats {

Result<mesh::RawTets> parse_medit(std::string_view text, const std::string& name);

}  // namespace trocar::formats
