#pragma once

// A relay needs more than its session: a certificate, the code that it was given, signals, figures
// for monitoring, and words for people.

#include "common/base/result.h"
#include "server/app/relay/options.h"

namespace trocar::app {

// Until the session has ended, or a signal or --seconds ends it. An error says why there was no
// session, or why it could not go on.
Status run_relay(const RelayOptions& options);

// Says whether the addresses and files that the options name can be used, without making anything
// or asking anybody.
Status check_relay(const RelayOptions& options);

}  // namespace trocar::app
