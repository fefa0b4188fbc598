#pragma once

#include "common/base/result.h"
#include "server/app/server/options.h"

namespace trocar::app {

// Says whether a start with these options would succeed: reads every file that it would read, and
// looks whether those that it would write can be. Binds no port, and makes nothing. An error names
// the option and where it comes from.
Status check_start(const ServerOptions& options);

// Says whether what a session writes besides its recording can be written: --summary at its end,
// and --ready-file. A start asks this before it does anything else.
Status check_end(const ServerOptions& options);

}  // namespace trocar::app
