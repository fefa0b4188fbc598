#pragma once

// These functions carry what a tick took from outside between the simulation's structs and the
// journal's messages.

#include "common/base/result.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::proto {
class TickRecord;
}

namespace trocar::recording {

// Decisions are written only where they differ from `previous` (null: always).
void to_message(const step::TickRecord& record, const step::TickDecisions* previous,
                proto::TickRecord& message);

// Untrusted bytes: every field is checked as it was when it came from the network. `record` has the
// previous tick's decisions on entry and keeps them where the message has none.
Status from_message(const proto::TickRecord& message, step::TickRecord& record);

}  // namespace trocar::recording
