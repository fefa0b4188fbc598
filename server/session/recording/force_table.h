#pragma once

// The forces of a recording as a table (CSV): a row for each tool of each frame, with what the
// tissue did to the tool and, where a hand felt it, what that hand felt at the same pose.

#include <string>

#include "common/base/result.h"

namespace trocar::recording {

struct ForceTableCounts {
  std::uint64_t rows = 0, felt = 0;  // rows; of these with what a hand felt
  std::uint64_t reports = 0;         // of hands, that were read
  std::uint64_t left_out = 0;        // reports that the recording had no room for
  std::uint64_t refused = 0;         // reports out of their ranges
};

// Errors: the recording cannot be read, or the table cannot be written.
Result<ForceTableCounts> write_force_table(const std::string& journal, const std::string& table);

}  // namespace trocar::recording
