#pragma once

// Puts the recordings of one session together into one: what a server has recorded that was killed,
// and what the servers have that went on with it. Its ticks follow each other without a gap, its
// times are those of the first part, and a mark in /gap says where another server has gone on.
//
//   trocar.merged   parts: their names; joins: the ticks after which another one goes on

#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/tick.h"

namespace trocar::recording {

inline constexpr const char* kMergedMetadataName = "trocar.merged";

struct MergeReport {
  std::vector<std::string> parts;  // their paths, in order of time
  std::vector<Tick> joins;         // after these; one less than parts
  std::uint64_t messages = 0;
  Tick last_tick = 0;
  std::uint64_t torn_frames = 0;  // before a join, of which the killed server has not written all
  bool has_end = true;            // false: the last part was cut short
};

// `parts`: all recordings of the session, in any order, in one folder. `to` must not exist. Errors:
// a part is missing, or does not go on with another one, or has damage.
Result<MergeReport> merge(const std::vector<std::string>& parts, const std::string& to);

}  // namespace trocar::recording
