#pragma once

// The rules by which a session bleeds, between the journal's message and the server's own.

#include <optional>

#include "common/base/result.h"
#include "common/journal/session_journal.h"
#include "server/tissue/bleeding/rules.h"

namespace trocar::recording {

void to_message(const bleeding::Rules& rules, proto::BleedingRules& message);

// Untrusted bytes: rules that come out are within their limits.
Result<bleeding::Rules> from_message(const proto::BleedingRules& message);

// Nothing: the session did not bleed.
Result<std::optional<bleeding::Rules>> recorded_bleeding(journal::SessionJournal& journal,
                                                         const std::string& path);

}  // namespace trocar::recording
