#pragma once

// This is the identify command of trocar-organ.

#include <CLI/CLI.hpp>
#include <string>

#include "common/base/result.h"
#include "server/lab/fit/identify.h"

namespace trocar::app {

struct IdentifyCommand {
  std::string curves, out, form = "unsplit";
  double length_mm = 0, area_mm2 = 0;
  fit::SpecimenSize size;
  fit::IdentifyOptions options;
  std::vector<std::string> start;  // "g:tau_s" each
};
void add_identify_command(CLI::App& app, IdentifyCommand& command);
Status run_identify(IdentifyCommand command);

}  // namespace trocar::app
