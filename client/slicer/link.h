#pragma once

// A session and those who are connected by OpenIGTLink, in one loop: what came from the session is
// published, and what peers say becomes samples of tools, organs and sessions. The session's own
// connection has a thread (client/net); nothing that a peer does holds it up.

#include "client/slicer/options.h"

namespace trocar::slicer {

// Until the session ends, or with --serve until a signal or --seconds.
Result<ExitCode> run_link(const LinkOptions& options);

}  // namespace trocar::slicer
