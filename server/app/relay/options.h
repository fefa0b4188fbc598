#pragma once

// trocar-relay's command line, and the configuration file that it may name.

#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/secure/join_code.h"
#include "server/app/config/option_origins.h"
#include "server/bus/bus_place.h"
#include "server/watch/follow/sessions.h"

namespace trocar::app {

struct RelayOptions {
  follow::SessionAddress server;
  std::optional<secure::JoinCode> code;  // empty: that of the server on this machine
  std::string address = "127.0.0.1";
  std::uint16_t port = 7695;
  std::string name;                            // in the server's list; empty: made of the port
  std::vector<std::string> further_addresses;  // "HOST:PORT"
  bus::BusPlace nats;                          // without a URL: none
  std::string publish, from_nats;  // the session's name there, one of the two; empty: not asked for
  int most_watchers = 1000;
  bool is_stream_only = false;
  std::string metrics_address;  // empty: no figures
  std::uint16_t metrics_port = 0;
  std::string state_folder, certificate_file, key_file;
  double seconds = 0;  // 0: until told to end
  std::string ready_file;
  std::string log_level = "info", log_format = "text";
  bool checks_config = false;
  std::string config_file;
  OptionOrigins origins;
};

// Nothing if the program is done (after --help or --version).
Result<std::optional<RelayOptions>> parse_relay_command_line(int argc, char** argv);

}  // namespace trocar::app
