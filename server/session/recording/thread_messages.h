#pragma once

// The rules by which a session has surgical thread, between the journal's message and the server's
// own.

#include <optional>

#include "common/base/result.h"
#include "common/journal/session_journal.h"
#include "server/tissue/thread/rules.h"

namespace trocar::recording {

void to_message(const thread::Rules& rules, proto::ThreadRules& message);

// Untrusted bytes: rules that come out are within their limits.
Result<thread::Rules> from_message(const proto::ThreadRules& message);

// Nothing: the session had no thread.
Result<std::optional<thread::Rules>> recorded_threads(journal::SessionJournal& journal,
                                                      const std::string& path);

}  // namespace trocar::recording
