#pragma once

// Simulates a recorded session again and compares: the state hash of every tick, every snapshot
// byte for byte, and the surface stream as decoded, by its CRC.
//
// With another sim_version the simulation cannot be repeated: then only the stored bytes are
// checked (chunk CRCs, surface stream) and the report says so. Where ticks are missing (a marked
// gap, a damaged chunk) re-simulation goes on from the next snapshot. A session that had a
// reduction can be simulated again only with the same one.

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/base/tick.h"
#include "common/journal/session_journal.h"
#include "server/organs/organ/local_reduction.h"

namespace trocar::recording {

struct Mismatch {
  Tick tick = 0;
  std::string what;  // "state hash", "snapshot", "surface"
};

struct VerifyReport {
  bool is_resimulated = false;  // false: other sim_version, bytes checked only
  Tick first_tick = 0, last_tick = 0;
  std::uint64_t ticks_verified = 0;
  std::uint64_t ticks_missing = 0;  // in gaps
  std::uint64_t snapshots_verified = 0, surfaces_verified = 0;
  std::optional<Mismatch> first_mismatch;
  std::uint64_t last_hash = 0;
  std::string container;  // one line: finished, or recovered and what was lost

  bool ok() const { return !first_mismatch.has_value(); }
};

// The reduction with which a session can be simulated again, from `file`, or null if it had none.
// Error: it is missing, not that of the session, or there should be none.
Result<std::shared_ptr<const organ::LocalReduction>> reduction_of(const std::string& journal,
                                                                  const journal::SessionInfo& info,
                                                                  const organ::Organ& organ,
                                                                  const std::string& file);

// `progress` is called now and then with the tick reached. reduction_file: of the session; empty:
// it had none. Errors: the file cannot be read at all, or the reduction is missing or another.
Result<VerifyReport> verify_journal(const std::string& path,
                                    const std::function<void(Tick, Tick last)>& progress = {},
                                    const std::string& reduction_file = {});

}  // namespace trocar::recording
