#pragma once

// Reader of Gmsh files: versions 1, 2.2 and 4.1, the latter two as text or binary (little-endian).
//
// Read: nodes and the four-node tetrahedra; ids may be sparse and in any order. Physical groups of
// tets become regions, those of points, lines and triangles become sets of nodes. Skipped:
// sections of other names. Rejected with `file:line: what, what to do`: other versions, other
// volume elements, elements of second order, anything malformed, and numbers out of range. A count
// in the file is compared with what follows and never allocated for.
//
// Source: Geuzaine, Remacle: Gmsh reference manual, chapters "MSH file format" and "Legacy
// formats".

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "server/organs/mesh/raw_tets.h"

namespace trocar::formats {

// `name` stands for the path in errors.
Result<mesh::RawTets> parse_gmsh(std::string_view text, const std::string& name);

}  // namespace trocar::formats
