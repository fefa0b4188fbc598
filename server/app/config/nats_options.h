#pragma once

// The options of programs that use NATS: where it is, and how one gets in.

#include <CLI/CLI.hpp>

#include "server/bus/bus_place.h"

namespace trocar::app {

// Adds --nats, --nats-ca and --nats-creds. `meaning` says what --nats is for; `app` and `place`
// outlive the parsing.
void add_nats_options(CLI::App& app, bus::BusPlace& place, const char* meaning);

}  // namespace trocar::app
