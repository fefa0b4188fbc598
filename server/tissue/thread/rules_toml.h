#pragma once

// Threads, pegs and floor in TOML: of a scenario, or in a file of their own for a session. Errors
// name file, line and key.

#include <filesystem>
#include <optional>

#include "common/base/result.h"
#include "server/tissue/thread/rules.h"

namespace trocar::tool {
class Document;
class TableReader;
}  // namespace trocar::tool

namespace trocar::thread {

// Reads [[thread]], [[peg]] and [floor] of a larger document; nothing: there is no thread. After an
// error, which the document keeps, what is returned means nothing.
std::optional<Rules> read_rules(tool::Document& document, tool::TableReader& root,
                                const std::optional<Vec3d>& gravity_m_s2);

// Reads a file that has these tables alone, and a thread.
Result<Rules> read_rules_file(const std::filesystem::path& path);

}  // namespace trocar::thread
