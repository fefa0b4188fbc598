#pragma once

// The program trocar-crtk: arms between a bus and a session.
//
//   bus -- servo commands --> Arm --> ToolSample --> Seat --> server
//   bus <-- measured_..., operating_state -- Arm <-- frames -- Seat

#include "client/crtk/options.h"
#include "common/base/exit_code.h"

namespace trocar::crtk {

// Until the session ends, somebody wants it to end, or an error.
Result<ExitCode> run_crtk(const CrtkOptions& options);

// SIGINT and its like ask it to leave.
void install_signal_handlers();

}  // namespace trocar::crtk
