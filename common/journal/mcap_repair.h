#pragma once

// A recording whose writer was killed, or of which a part is damaged, written again as a whole file
// with index and summary, so that every MCAP reader takes it. What was lost stays lost: a metadata
// record says so.
//
//   trocar.repaired   file, dropped_bytes and damaged_chunks of the recording that it was made of

#include <string>

#include "common/base/result.h"

namespace trocar::journal {

inline constexpr const char* kRepairedMetadataName = "trocar.repaired";

struct RepairReport {
  std::uint64_t messages = 0;        // written
  std::uint64_t dropped_bytes = 0;   // at the end, of a record that was torn
  std::uint64_t damaged_chunks = 0;  // left out
};

// `to` must not exist. Errors: Usage if nothing is wrong with `from`; BadFile if it is of a session
// and its organ is lost, without which nothing can use it.
Result<RepairReport> repair(const std::string& from, const std::string& to);

}  // namespace trocar::journal
