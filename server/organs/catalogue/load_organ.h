#pragma once

// One place where every program gets its organ from.

#include <span>
#include <string>

#include "common/base/result.h"
#include "server/organs/catalogue/import_organ.h"
#include "server/organs/organ/organ.h"

namespace trocar::catalogue {

struct BuiltIn {
  const char* name;
  const char* text;  // what it is, in a few words
  Result<organ::Organ> (*make)();
};

// All of them; who asks for one by name needs no file.
std::span<const BuiltIn> built_in_organs();

// Says that no built-in organ has this name, which was probably meant, and what to do.
std::string no_built_in(const std::string& name);

// The name of a built-in organ, or the path of an .organ file, of a part file (.toml, part_file.h)
// or of a mesh (import_organ.h). A mesh is imported with the default options, and warnings are
// logged.
Result<organ::Organ> load_organ(const std::string& spec);

}  // namespace trocar::catalogue
