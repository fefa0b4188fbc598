#pragma once

// Reads what a C++ file declares at namespace and class scope, as far as counting needs it: classes
// with how many names they declare, and functions with their length and parameters. It reads text,
// not C++: macros stay as they are, and what stands inside function bodies is passed over.

#include <cstddef>
#include <string>
#include <vector>

#include "tests/architecture/source_tree.h"

namespace trocar::architecture {

struct ClassRead {
  std::string name;  // with those around it: "NetSource::Session"
  int line = 0;      // from 1
  // Constructors, each overload and static ones count; so do members, but neither aliases, friends,
  // nor what nested types declare.
  std::size_t methods = 0, members = 0;
};

struct FunctionRead {
  std::string name;
  int line = 0;
  std::size_t lines = 0;  // from its name to the end of its body
  std::size_t parameters = 0;
};

struct Declarations {
  std::vector<ClassRead> classes;
  std::vector<FunctionRead> functions;  // those with a body
};

Declarations read_declarations(const SourceFile& file);

}  // namespace trocar::architecture
