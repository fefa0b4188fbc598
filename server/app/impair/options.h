#pragma once

// Reads the command line of trocar-impair.

#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/impair/network.h"

namespace trocar::app {

struct ImpairOptions {
  impair::ProxyOptions proxy;
  double seconds = 0;  // 0: until Ctrl-C
  std::string summary_file, ready_file;
  std::string log_level = "info";
};

// "AFTER_S[:FOR_S]"; nothing: at once and for good. An error names the option.
Result<impair::Outage> parse_outage(const std::string& option, const std::string& text);

// Nothing when --help or --version was asked for, and printed.
Result<std::optional<ImpairOptions>> parse_impair_command_line(int argc, char** argv);

// Says for people what a direction does: "30 ms and up to 5 more, 1 % lost".
std::string describe(const impair::Impairment& impairment);

}  // namespace trocar::app
