#pragma once

// One place where every program gets its organ from.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/organs/mesh/raw_tets.h"
#include "server/organs/organ/fix_rule.h"
#include "server/organs/organ/organ.h"

namespace trocar::catalogue {

struct ImportOptions {
  mesh::Unit unit = mesh::Unit::Metre;
  organ::FixRule fix;               // bottom:0.2
  std::optional<std::string> name;  // instead of the file's stem
};

struct ImportedOrgan {
  organ::Organ organ;
  std::vector<std::string> warnings;  // one line each: what was repaired
};

// Reads a mesh file (.msh, Gmsh 2.2 ASCII) and gives it the default material.
Result<ImportedOrgan> import_organ(const std::filesystem::path& path, const ImportOptions& options);

// "liver" (measured), "elastic-liver", "lattice", "plate", "stomach", "chest", or the path of an
// .organ or .msh file. A mesh is imported with the default options, and its warnings are logged.
Result<organ::Organ> load_organ(const std::string& spec);

}  // namespace trocar::catalogue
