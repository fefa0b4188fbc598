#pragma once

// The lesson of a recording as a table (CSV): a row for each thing that an instructor did, that
// somebody said, or that somebody showed.

#include <cstdint>
#include <string>

#include "common/base/result.h"

namespace trocar::recording {

struct LessonTableCounts {
  std::uint64_t rows = 0;
  std::uint64_t left_out = 0;  // entries that the recording had no room for
};

// Errors: the recording cannot be read, or the table cannot be written.
Result<LessonTableCounts> write_lesson_table(const std::string& journal, const std::string& table);

}  // namespace trocar::recording
