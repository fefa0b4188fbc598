#pragma once

// One session from start to end: simulation thread, I/O thread (the caller's), journal.
//
//   listen -> simulate ... signal or --seconds -> last frame -> barrier (2 s) -> Goodbye to all
//          -> journal closed -> summary

#include <memory>

#include "common/base/result.h"
#include "server/app/server/options.h"

namespace trocar::app {

// Runs until the session has ended. Ok also after SIGTERM and SIGINT.
Status run_server(const ServerOptions& options);

}  // namespace trocar::app
