#pragma once

#include <filesystem>

#include "common/base/result.h"

namespace trocar {

// These look before long work whether its end could write there, and make nothing. A full disk is
// not seen. Errors (ErrorCode::ResourceMissing) say what is in the way.

// The file is not there yet or may be replaced, in a folder that is there.
Status check_writable(const std::filesystem::path& file);
// The folder is there, or can be made with those above it.
Status check_writable_folder(const std::filesystem::path& folder);

}  // namespace trocar
