#pragma once

// One place where every program gets its organ from.

#include <string>

#include "common/base/result.h"
#include "server/organs/catalogue/import_organ.h"
#include "server/organs/organ/organ.h"

namespace trocar::catalogue {

// "liver" (measured), "elastic-liver", "lattice", "plate", "stomach", "chest", "pegs", or the path
// of an .organ file or of a mesh (import_organ.h). A mesh is imported with the default options, and
// its warnings are logged.
Result<organ::Organ> load_organ(const std::string& spec);

}  // namespace trocar::catalogue
