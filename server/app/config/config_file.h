#pragma once

// The configuration file of a program (--config): TOML whose keys are the long options of the
// command line, without their dashes. CLI11 gives each value to its option as if it had been typed,
// unless the command line has that option, too. CLI11's own reader takes anything for TOML, so that
// toml++ reads the file here.

#include <CLI/CLI.hpp>
#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "common/base/result.h"
#include "server/app/config/option_origins.h"

namespace trocar::app {

// Adds --config, and --check-config, which says what of a start it `checks`.
void add_config_options(CLI::App& app, bool& checks_config, const std::string& checks);

// Checks the text of one option alone: its form, its limits.
using CheckOption = std::function<Status(const std::string& key, const std::string& text)>;

// Gives the text to that option of an `app` made for this, then calls `finish`, which checks
// options beside each other. The error's message does not begin with the option's name.
Status check_option(CLI::App& app, const std::string& key, const std::string& text,
                    const std::function<Status()>& finish);

// Parses a command line that may name such a file, into the options of `app`. Returns false if the
// program is done (after --help or --version). The file may not have unknown keys, values of the
// wrong kind and those that `check` refuses; errors name file, line and key, and point at
// `example`.
Result<bool> parse_with_config(CLI::App& app, int argc, char** argv, CheckOption check,
                               OptionOrigins& origins, const char* example);

// Returns the file of --config, empty if none was named.
std::string config_file_of(const CLI::App& app);

// Does all of this for a program's CommandLine: it has app(), options() with `origins` and
// `config_file`, check() for one option as CheckOption, and finish() for all. Nothing if the
// program is done.
template <typename CommandLine>
auto read_command_line(int argc, char** argv, const char* example)
    -> Result<std::optional<std::decay_t<decltype(std::declval<CommandLine&>().options())>>> {
  CommandLine line;
  auto& options = line.options();
  const CheckOption check = [](const std::string& key, const std::string& text) {
    return CommandLine().check(key, text);
  };
  const auto parsed = parse_with_config(line.app(), argc, argv, check, options.origins, example);
  if (!parsed) return parsed.error();
  std::optional<std::decay_t<decltype(options)>> read;
  if (!*parsed) return read;
  if (const auto finished = line.finish(); !finished)
    return Error{ErrorCode::Usage, options.origins.placed(finished.error().message)};
  options.config_file = config_file_of(line.app());
  read = std::move(options);
  return read;
}

}  // namespace trocar::app
