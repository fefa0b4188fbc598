#pragma once

#include <filesystem>
#include <string_view>

#include "common/base/result.h"

namespace trocar {

// Written beside and renamed: whoever waits for the file never sees half of it.
Status write_text_file(const std::filesystem::path& path, std::string_view text);

}  // namespace trocar
