#pragma once

// Reads a recording that was just written, as a program would that knows nothing of how it came
// about: chunk by chunk with their CRCs, ticks one by one, and each surface from the one before.

#include <string>

#include "common/base/result.h"
#include "common/base/tick.h"

namespace trocar::recording {

struct Written {
  std::uint64_t messages = 0;  // without overviews
  Tick begin = 0, end = 0;     // after `begin`, up to `end`
};

// Error: the file has damage, other messages than were written, ticks that do not follow each
// other but for marked gaps, or surfaces that cannot be decoded where the recording says that they
// can.
Status read_back(const std::string& path, const Written& written);

}  // namespace trocar::recording
