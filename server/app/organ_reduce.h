#pragma once

// The reduce command of trocar-organ.

#include <CLI/CLI.hpp>
#include <string>

#include "common/base/result.h"
#include "server/reduction/build.h"

namespace trocar::app {

struct ReduceCommand {
  std::string organ, out, folder, method = "dogan";
  double radius_mm = 15, influence_mm = 45;
  std::size_t check_places = 12, check_creep = 2;
  reduction::Settings settings;
};
void add_reduce_command(CLI::App& app, ReduceCommand& command);
Status run_reduce(ReduceCommand command);

}  // namespace trocar::app
