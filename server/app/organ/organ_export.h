#pragma once

// trocar-organ export: an organ's mesh in files of other programs. trocar-organ inspect --picture.

#include <CLI/CLI.hpp>
#include <string>

#include "common/base/result.h"
#include "server/organs/organ/organ.h"

namespace trocar::app {

struct ExportCommand {
  std::string organ, out;
  std::string unit = "m";
};
void add_export_command(CLI::App& app, ExportCommand& command);
Status run_export(const ExportCommand& command);

// A PNG of the organ from three sides; prints the length of its scale bar.
Status draw(const organ::Organ& organ, const std::string& path);

}  // namespace trocar::app
