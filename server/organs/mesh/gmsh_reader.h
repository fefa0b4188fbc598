#pragma once

// Reader of Gmsh 2.2 ASCII files (`gmsh -3 -format msh22`), for files that nobody vouches for.
//
// Read: $Nodes and the four-node tetrahedra (type 4) of $Elements; ids may be sparse and in any
// order. Skipped: points, lines and triangles, physical groups and other tags, sections of other
// names. Rejected with `file:line: what, what to do`: other versions, binary files, other volume
// elements, anything malformed, and numbers out of range. A count in the file is compared with what
// follows and never allocated for. What make_mesh() (raw_tets.h) repairs or rejects applies after
// that.

#include <filesystem>
#include <string_view>

#include "common/base/result.h"
#include "server/organs/mesh/raw_tets.h"

namespace trocar::mesh {

Result<ImportedMesh> read_gmsh(const std::filesystem::path& path, Unit unit = Unit::Metre);

// The same from memory; `name` stands for the path in errors.
Result<ImportedMesh> parse_gmsh(std::string_view text, Unit unit, const std::string& name);

}  // namespace trocar::mesh
