#pragma once

// The size of a picture, from its header alone: nothing is unpacked.
//
// Sources: ISO/IEC 15948 (PNG), 11.2.2; ISO/IEC 10918-1 (JPEG), B.1 and B.2.2.

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

namespace trocar::wire {

// Width and height, pixels, of a PNG or JPEG file's bytes; nothing if it does not say them.
std::optional<std::array<std::size_t, 2>> picture_size(std::string_view file);

}  // namespace trocar::wire
