#pragma once

// The command line of a program: its help, and errors of one line that say what to do. --help of a
// command shows those of the program's examples that begin with it.

#include <CLI/CLI.hpp>

#include "common/base/result.h"

namespace trocar::command_line {

// Gives --help its form, and each command its examples out of the program's. Call it once all
// options are there.
void prepare_help(CLI::App& app);

// Says what became of a command line that was not parsed: false if --help or --version was asked
// for and printed, else an error of one line.
Result<bool> answer(const CLI::App& app, const CLI::ParseError& error);

// Does both and parses. False: the program is done, as answer() has it.
Result<bool> parse_command_line(CLI::App& app, int argc, char** argv);

}  // namespace trocar::command_line
