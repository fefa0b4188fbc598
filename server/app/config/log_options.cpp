#include "server/app/config/log_options.h"

#include "common/command_line/limits.h"

namespace trocar::app {

void add_log_options(CLI::App& app, std::string& level, std::string& format) {
  app.add_option("--log-level", level, "error, warn, info, debug or off")
      ->check(command_line::one_of({"error", "warn", "info", "debug", "off"}))
      ->type_name("LEVEL")
      ->capture_default_str();
  app.add_option("--log-format", format, "how it is said: text, or json: an object per line")
      ->check(command_line::one_of({"text", "json"}))
      ->type_name("FORMAT")
      ->capture_default_str();
}

}  // namespace trocar::app
