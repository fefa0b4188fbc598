#pragma once

#include <filesystem>
#include <vector>

#include "common/base/result.h"

namespace trocar::app {

// The recordings (.mcap) of a folder and of those below it, sorted; the path alone if it is none.
// Errors: a folder cannot be read, or there are no recordings, or more than 100000.
Result<std::vector<std::filesystem::path>> recordings_of(const std::filesystem::path& path);

}  // namespace trocar::app
