#pragma once

// This is the calibrate command of trocar-organ.

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "server/lab/calibration/calibrate.h"

namespace trocar::app {

struct CalibrateCommand {
  std::string organ, out, folder;
  double error_percent = 3, depth_mm = 12;
  std::optional<double> radius_mm;
  std::size_t check_places = 4;
  calibration::Settings settings;
};
void add_calibrate_command(CLI::App& app, CalibrateCommand& command);
Status run_calibrate(CalibrateCommand command);

}  // namespace trocar::app
