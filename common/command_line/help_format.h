#pragma once

// This is how --help looks: a heading for each group of options, plain words for kinds and limits
// of values, and the usual value in brackets at the end of what an option does.

#include <CLI/CLI.hpp>
#include <string>

namespace trocar::command_line {

class HelpFormat : public CLI::Formatter {
 public:
  HelpFormat();

  std::string make_subcommands(const CLI::App* app, CLI::AppFormatMode mode) const override;
  std::string make_option_opts(const CLI::Option* option) const override;
  std::string make_option_desc(const CLI::Option* option) const override;
};

}  // namespace trocar::command_line
