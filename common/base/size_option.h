#pragma once

#include <string>
#include <utility>

#include "common/base/result.h"

namespace trocar {

// Reads the option --size, such as 1280x720: width and height in pixels, from these least ones to
// 7680 and 4320. Error: names the option, the text and the limits.
Result<std::pair<int, int>> parse_size(const std::string& text, int least_width, int least_height);

}  // namespace trocar
