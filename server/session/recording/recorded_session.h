#pragma once

// These functions read from a journal what a simulation needs to run its session again: the organ,
// the hands, and what each tick took from outside.

#include <functional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/journal/session_journal.h"
#include "server/organs/organ/organ.h"
#include "server/session/participants/roster.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::recording {

// The organ that the session names. `path` is the journal's, for messages.
Result<organ::Organ> recorded_organ(journal::SessionJournal& journal, const std::string& path);

// One participant for each slot with tools that was ever taken, with tools of the default shape.
std::vector<participants::Participant> recorded_hands(const journal::SessionInfo& info);

// Calls `take` with each tick's record in order, decisions filled in. Ends at the first error, of a
// record or of `take`, or when `take` sets `stop`.
Status read_ticks(journal::SessionJournal& journal,
                  const std::function<Status(const step::TickRecord& record, bool& stop)>& take);

}  // namespace trocar::recording
