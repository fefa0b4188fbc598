#pragma once

#include <filesystem>
#include <string>

#include "common/base/result.h"

namespace trocar {

// Error: there is a recording or an organ of this name, which the output of an option would
// replace. `option`: what named the output, such as "--summary".
Status refuse_to_replace_kept(const std::string& option, const std::filesystem::path& path);

// Says before long work whether the file that an option names may be written at its end: the above,
// and what check_writable() says. Error: with the option before it.
Status check_output(const std::string& option, const std::filesystem::path& path);

}  // namespace trocar
