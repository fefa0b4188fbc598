#pragma once

// The rules of the architecture. Each returns its breaches, one line each: "path:line: what, what
// to do". docs/the-source.md says the same.

#include <string>
#include <vector>

#include "tests/architecture/source_tree.h"

namespace trocar::architecture {

using Breaches = std::vector<std::string>;

// Every source folder is a layer, has a CMakeLists.txt that lists all of its sources and headers,
// and depends only on layers above it; server and client do not depend on each other.
Breaches check_folders(const SourceTree& tree);
// Every #include "..." exists and is of the own folder or of one seen through DEPENDS.
Breaches check_includes(const SourceTree& tree);
// server/session/net moves bytes: it sees no simulation state, not even through others.
Breaches check_net_sees_no_world(const SourceTree& tree);
// Generated messages only where bytes become meaning.
Breaches check_protobuf(const SourceTree& tree);
// OpenGL, GLFW, EGL and Dear ImGui only in the folders that draw.
Breaches check_graphics(const SourceTree& tree);
// Folders whose arithmetic reaches the tick hash: no clocks, no random numbers, no unordered
// containers, no libm functions but the exactly rounded ones.
Breaches check_determinism(const SourceTree& tree);
// No file over 600 lines, no path of somebody's machine, #pragma once in each header.
Breaches check_files(const SourceTree& tree);

}  // namespace trocar::architecture
