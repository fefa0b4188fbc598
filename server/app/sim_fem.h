#pragma once

// trocar-sim --solver fem: a scenario on the off-line finite elements, with progress, and with a
// state after each step from which a stopped run goes on.

#include <CLI/CLI.hpp>
#include <csignal>
#include <filesystem>
#include <string>

#include "common/base/result.h"
#include "common/scene/scenario.h"

namespace trocar::app {

struct FemCommand {
  std::string elements = "quadratic", material, response = "instantaneous", resume;
  double step_ms = 1, bulk_ratio = 0;
};
void add_fem_options(CLI::App& app, FemCommand& command);

// Ends early, complete, when `stop_requested` is set.
Status run_fem(const FemCommand& command, scene::ResolvedScenario resolved,
               const std::filesystem::path& folder, unsigned threads,
               const volatile std::sig_atomic_t& stop_requested);

}  // namespace trocar::app
