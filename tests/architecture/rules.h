#pragma once

// The rules of the architecture. Each returns its breaches, one line each: "path:line: what, what
// to do". docs/the-source.md says the same.

#include <string>
#include <vector>

#include "tests/architecture/source_tree.h"

namespace trocar::architecture {

using Breaches = std::vector<std::string>;

// Every source folder is a layer, has a CMakeLists.txt that lists all of its sources and headers
// and says what it is about, and depends only on layers above it. Server and client do not depend
// on each other, and what they share depends on neither.
Breaches check_folders(const SourceTree& tree);
// Every #include "..." names an existing file from the root, and a source includes the header of
// its own name first.
Breaches check_includes(const SourceTree& tree);
// A CMakeLists.txt lists what the sources include, no less and no more: the folders that headers
// include are its DEPENDS, those that only sources include its USES. A program's DEPENDS are the
// folders that its files include.
Breaches check_dependencies(const SourceTree& tree);
// server/session/net moves bytes: it links nothing else of the server, not even through others.
Breaches check_net_sees_no_world(const SourceTree& tree);
// No folder links one of TROCAR_OFFLINE_FOLDERS, not even through others, unless it is one itself.
Breaches check_sessions_see_no_tool(const SourceTree& tree);
// Generated messages only where bytes become meaning.
Breaches check_protobuf(const SourceTree& tree);
// OpenGL, GLFW, EGL and Dear ImGui only in the folders that draw.
Breaches check_graphics(const SourceTree& tree);
// TROCAR_STATE_FOLDERS, whose arithmetic reaches the tick hash: no clocks, no random numbers, no
// unordered containers, no libm functions but the exactly rounded ones.
Breaches check_determinism(const SourceTree& tree);
// No file over 600 lines, no path of somebody's machine, #pragma once in each header.
Breaches check_files(const SourceTree& tree);

}  // namespace trocar::architecture
