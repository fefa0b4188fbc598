#pragma once

// Draws pictures of a recording in memory at equal steps of its own time, however long each takes,
// and writes them as numbered files. The same recording gives the same series. Thread: render
// thread.

#include "client/app/client_options.h"

namespace trocar::app {

Status write_picture_series(const ClientOptions& options);

}  // namespace trocar::app
