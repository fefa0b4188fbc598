#pragma once

// The commands list, start and end of trocar-hall, in words or as JSON on standard output.

#include "common/base/result.h"
#include "server/app/hall/options.h"

namespace trocar::app {

// Waits until a session that it starts runs, and until the recording of one that it ends is closed.
Status run_hall_command(const HallOptions& options);

}  // namespace trocar::app
