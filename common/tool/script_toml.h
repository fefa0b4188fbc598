#pragma once

// The `[[tool]]` tables, which scripts and scenarios share.

#include <vector>

#include "common/tool/script.h"
#include "common/tool/toml_reader.h"

namespace trocar::tool {

// At most `most` tools; none if the file has none or after an error, which the document keeps.
std::vector<ScriptTool> read_tools(Document& document, TableReader& root, std::size_t most);

}  // namespace trocar::tool
