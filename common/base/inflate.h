#pragma once

#include <string>
#include <string_view>

#include "common/base/result.h"

namespace trocar {

enum class Packing { Zlib, Gzip };

// Appends what was packed, all members of a gzip file. No memory is taken for a size that the data
// announce. Errors: damaged or cut off, or `out` would be longer than `most_bytes`; one line, which
// names neither a file nor the limit.
Status inflate_into(std::string_view packed, Packing packing, std::size_t most_bytes,
                    std::string& out);

}  // namespace trocar
