#pragma once

// The `[[tool]]` tables, which scripts and scenarios share.

#include <vector>

#include "common/scene/script.h"
#include "common/scene/toml_reader.h"

namespace trocar::scene {

// At most `most` tools; none if the file has none or after an error, which the document keeps.
std::vector<ScriptTool> read_tools(Document& document, TableReader& root, std::size_t most);

}  // namespace trocar::scene
