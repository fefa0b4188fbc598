#pragma once

// This is the command line of trocar-crtk.

#include <optional>
#include <string>
#include <vector>

#include "client/crtk/arm.h"
#include "client/crtk/bus.h"
#include "client/net/way_in.h"
#include "common/tool/tool.h"

namespace trocar::crtk {

struct ArmOptions {
  ArmSettings settings;
  tool::ToolShape shape;
};

struct CrtkOptions {
  std::string server = "127.0.0.1:7690";
  net::WayIn way_in;
  double wait_s = 15;  // for a server that is not there yet
  double seconds = 0;  // 0: until the session ends
  BusSettings bus;
  std::vector<ArmOptions> arms;
  std::string log_level = "info";
};

// No value: --help or --version was asked for and printed.
Result<std::optional<CrtkOptions>> parse_crtk_command_line(int argc, char** argv);

}  // namespace trocar::crtk
