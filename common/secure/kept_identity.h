#pragma once

// A program's own certificate and key in its state folder: made at the first start, used from then
// on.

#include <filesystem>
#include <string>

#include "common/base/result.h"
#include "common/secure/certificate.h"

namespace trocar::secure {

// Reads NAME.crt and NAME.key in `folder`, which is a private one, or makes them. An error names
// the file that cannot be read or written.
Result<Identity> read_or_make_identity(const std::filesystem::path& folder,
                                       const std::string& name);

}  // namespace trocar::secure
