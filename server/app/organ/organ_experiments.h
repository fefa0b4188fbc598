#pragma once

// The fit and settle commands of trocar-organ.

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace trocar::app {

struct FitCommand {
  std::string scenario, curve_file;
  std::vector<std::string> parameters;
  std::string region, curve, out, organ;
};
void add_fit_command(CLI::App& app, FitCommand& command);
Status run_fit(const FitCommand& command);

struct SettleCommand {
  std::string organ, out;
  std::vector<double> gravity;  // empty: the organ's own, or the earth's
};
void add_settle_command(CLI::App& app, SettleCommand& command);
Status run_settle(const SettleCommand& command);

}  // namespace trocar::app
