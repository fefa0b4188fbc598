#pragma once

// The options of programs that run for long: what they say of themselves, and how.

#include <CLI/CLI.hpp>
#include <string>

namespace trocar::app {

// Adds --log-level and --log-format; `level` and `format` outlive the parsing.
void add_log_options(CLI::App& app, std::string& level, std::string& format);

}  // namespace trocar::app
