#pragma once

// trocar-sim --solver fem: a scenario on the off-line finite elements, with progress, and with a
// state after each step from which a stopped run goes on; its probes then go to a file of their
// own, named after the step.

#include <CLI/CLI.hpp>
#include <csignal>
#include <filesystem>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "server/lab/scenario/scenario.h"

namespace trocar::app {

struct FemCommand {
  std::string material, resume;
  std::optional<std::string> elements, response;
  std::optional<double> step_ms, bulk_ratio;
};
void add_fem_options(CLI::App& app, FemCommand& command);
// Error: one is given that would do nothing.
Status check_fem_options(const FemCommand& command, bool is_fem);

// Ends early, complete, when `stop_requested` is set.
Status run_fem(const FemCommand& command, scenario::ResolvedScenario resolved,
               const std::filesystem::path& folder, unsigned threads,
               const volatile std::sig_atomic_t& stop_requested);

}  // namespace trocar::app
