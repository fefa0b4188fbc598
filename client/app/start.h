#pragma once

// The start of a client that was not told which session it is for: the start screen, in a window of
// its own, with the sessions that announce themselves on the local network and the one of a server
// that the same user has started on this machine. From there one also practises alone or hosts a
// lesson, with a server that the client starts, or watches a recording.

#include <memory>
#include <optional>
#include <string>

#include "client/app/client_options.h"
#include "client/app/own_server.h"

namespace trocar::app {

// Whether the options leave open which session to join.
bool wants_start_screen(const ClientOptions& options);

// Returns the options with what the person has chosen; nothing if the window was closed. `message`:
// why the last choice did not work. While nobody touches anything, a server of this machine that
// starts is joined by itself. `own`: the server that the person has started here, if any. `lesson`:
// this one is practised at once, without being chosen.
Result<std::optional<ClientOptions>> choose_session(ClientOptions options,
                                                    const std::string& message,
                                                    std::unique_ptr<OwnServer>& own,
                                                    const std::optional<std::string>& lesson);

}  // namespace trocar::app
