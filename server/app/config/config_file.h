#pragma once

// The configuration file of a program (--config): TOML whose keys are the long options of the
// command line, without their dashes. CLI11 gives each value to its option as if it had been typed,
// unless the command line has that option, too. CLI11's own reader takes anything for TOML, so that
// toml++ reads the file here.

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/app/config/option_origins.h"

namespace trocar::app {

// Checks the text of one option alone: its form, its limits.
using CheckOption = std::function<Status(const std::string& key, const std::string& text)>;

// CLI11 asks this when it meets --config. It refuses unknown keys, values of the wrong kind and
// those that `check` refuses, each with file, line and key.
class ConfigReader : public CLI::ConfigTOML {
 public:
  // `app` and `origins` outlive this. `example`: a file that errors point at.
  ConfigReader(const CLI::App& app, CheckOption check, OptionOrigins& origins, const char* example)
      : app_(app), check_(std::move(check)), origins_(origins), example_(example) {}

  // Throws CLI::ConfigError, as CLI11 wants it.
  std::vector<CLI::ConfigItem> from_config(std::istream& input) const override;

 private:
  Result<std::vector<CLI::ConfigItem>> read(const std::string& text, const std::string& file) const;

  const CLI::App& app_;
  const CheckOption check_;
  OptionOrigins& origins_;
  const char* const example_;
};

}  // namespace trocar::app
