#pragma once

// The client's main loop: poll the source, apply, send tool samples, draw.

#include "client/app/client_options.h"
#include "client/app/hands.h"
#include "client/replica/session_source.h"
#include "client/ui/hud.h"

namespace trocar::app {

// Set by SIGINT, SIGTERM and SIGHUP: leave politely.
void install_signal_handlers();
bool is_stop_requested();

// Runs with a given source until it closes, or the person, a signal or --seconds ends it.
// `after_lesson`: not null for a person who practises alone; it then has what that one wants who
// has left the lesson, if anything.
Result<ExitCode> run_with_source(const ClientOptions& options, replica::SessionSource& source,
                                 Hands& hands,
                                 std::optional<ui::AfterLesson>* after_lesson = nullptr);
// Runs two recordings beside each other.
Result<ExitCode> run_pair(const ClientOptions& options, replay::PairedSource& pair);
// Makes source and hands from the options, then runs. Where it is left open which session is meant,
// the start screen asks, again after a session that could not be joined.
Result<ExitCode> run_client(const ClientOptions& options);

}  // namespace trocar::app
