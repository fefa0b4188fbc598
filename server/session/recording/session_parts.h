#pragma once

// The recordings of one session. A session that has gone on after a crash lies in several, each of
// which names the one before it; they have to lie in one folder.

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/tick.h"
#include "common/journal/session_journal.h"

namespace trocar::recording {

struct SessionPart {
  std::string path;
  std::unique_ptr<journal::SessionJournal> journal;
  // The next part goes on after this tick: what came later is not of the session.
  Tick until = std::numeric_limits<Tick>::max();
};

struct SessionParts {
  std::vector<SessionPart> parts;  // in order of time, one or more; the last is the one asked for
  std::string missing;             // a line about what is not there before the first; else empty
};

// Empty: `later` goes on with `earlier`, after a tick that it has; else why it does not.
std::string mismatch(const journal::SessionInfo& earlier, const journal::SessionInfo& later);

// Error: the recording itself cannot be read.
Result<SessionParts> open_session_parts(const std::string& path);

}  // namespace trocar::recording
