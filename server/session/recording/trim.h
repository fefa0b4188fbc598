#pragma once

// Cuts a shorter recording out of one. It begins with the last keyframe at or before the time that
// is asked for: the state one frame before it is simulated again, and written as the first
// snapshot, so that what follows can be watched and verified by itself. Its ticks and times are
// those of the whole recording.
//
//   trocar.trimmed   file, from_tick and to_tick of what was kept

#include <string>

#include "common/base/result.h"
#include "common/base/tick.h"

namespace trocar::recording {

inline constexpr const char* kTrimmedMetadataName = "trocar.trimmed";

struct TrimOptions {
  Tick from = 0, to = 0;  // from < to
};

struct TrimReport {
  Tick from = 0, to = 0;  // kept: after the first, up to the second
  std::uint64_t messages = 0;
  // False: recorded with another sim_version, so that there is no state to begin with. It can be
  // watched; nothing of it can be simulated again.
  bool has_state = true;
};

// `to_path` must not exist. Errors: there is no frame in that time, or the recording is of a
// scenario, has a gap or damage before it, or does not simulate to its hashes.
Result<TrimReport> trim(const std::string& from_path, const std::string& to_path,
                        const TrimOptions& options);

}  // namespace trocar::recording
