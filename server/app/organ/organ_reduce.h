#pragma once

// This is the reduce command of trocar-organ.

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>

#include "common/base/result.h"
#include "server/papers/dogan/build.h"

namespace trocar::app {

struct ReduceCommand {
  std::string organ, out, folder;
  double radius_mm = 15, influence_mm = 45;
  std::size_t check_places = 12, check_creep = 2;
  dogan::Settings settings;
};
void add_reduce_command(CLI::App& app, ReduceCommand& command);
Status run_reduce(ReduceCommand command);

// Makes the folder of the comparison, and looks whether the file can be written: not after minutes
// of work.
Status check_outputs(const std::filesystem::path& folder, const std::string& out);

}  // namespace trocar::app
