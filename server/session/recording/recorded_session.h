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
#include "server/tissue/step/external_loads.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::recording {

// The organ that the session names. `path` is the journal's, for messages.
Result<organ::Organ> recorded_organ(journal::SessionJournal& journal, const std::string& path);

// Reads what acts on that organ besides tools; no rules if nothing does, or if the journal lacks
// them.
Result<step::LoadRules> recorded_loads(journal::SessionJournal& journal, const organ::Organ& organ,
                                       const std::string& path);

// Those of a recorded list whose slots exist.
std::vector<participants::Participant> participants_of(const proto::Participants& list);

// The hands that were there from a tick on, until the next list.
struct PresentHands {
  Tick tick = 0;
  std::vector<participants::Participant> hands;
};
Result<std::vector<PresentHands>> recorded_hands(journal::SessionJournal& journal);

// Calls `take` with each tick's record in order, decisions filled in. Ends at the first error, of a
// record or of `take`, or when `take` sets `stop`.
Status read_ticks(journal::SessionJournal& journal,
                  const std::function<Status(const step::TickRecord& record, bool& stop)>& take);

}  // namespace trocar::recording
