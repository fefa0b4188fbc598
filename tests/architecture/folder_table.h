#pragma once

// docs/folders.md: every folder of the layer list with its purpose, from the CMake files alone.
// After a change of either: ninja -C build/release folder_table, then
//   build/release/bin/folder_table > docs/folders.md

#include <string>

#include "tests/architecture/source_tree.h"

namespace trocar::architecture {

std::string folder_table(const SourceTree& tree);

}  // namespace trocar::architecture
