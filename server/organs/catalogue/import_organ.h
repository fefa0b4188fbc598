#pragma once

// An organ from another program's mesh, or from a surface that is filled with tetrahedra.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/organs/mesh/raw_tets.h"
#include "server/organs/organ/fix_rule.h"
#include "server/organs/organ/organ.h"

namespace trocar::catalogue {

inline constexpr int kDefaultFillNodes = 2000;

struct ImportOptions {
  mesh::Unit unit = mesh::Unit::Metre;
  organ::FixRule fix;                  // bottom:0.2
  std::optional<std::string> fix_set;  // the file's set of nodes that is held instead
  std::optional<std::string> name;     // instead of the file's stem
  std::optional<int> nodes;            // of the mesh in a surface, mesh::kMinFillNodes and on
};

struct ImportedOrgan {
  organ::Organ organ;
  std::vector<std::string> warnings;  // one line each: what was repaired
  std::vector<std::string> notes;     // one line each: how a surface was filled, regions, sets
};

// Reads a mesh file (formats/mesh_file.h) and gives it the default material, in each of its
// regions, too. Error: of a surface where `nodes` is out of range, of tets where it is given.
Result<ImportedOrgan> import_organ(const std::filesystem::path& path, const ImportOptions& options);

}  // namespace trocar::catalogue
