#pragma once

// trocar-hall's command line: a hall itself, or a command to one that runs.

#include <cstdint>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "server/bus/bus.h"

namespace trocar::app {

enum class HallCommand : std::uint8_t { Serve, List, Start, End };

struct HallOptions {
  HallCommand command = HallCommand::Serve;
  // These belong to a hall itself.
  std::string config_file, ready_file, log_level = "info", log_format = "text";
  bool checks_config = false;
  // These belong to a command.
  std::string at = "127.0.0.1:7694", host;
  std::uint16_t port = 0;        // of `at`
  bool has_tls = false;          // likewise
  bool sends_openly = false;     // the key, to another machine
  std::string certificate_file;  // what the hall has to show; empty: what this machine trusts
  std::string key_file;          // empty: without a key
  std::string what;              // the lesson to start, the session to end
  std::string name;              // of a new session; empty: the hall gives one
  bool is_json = false;
  bus::BusPlace nats;  // of both; without a URL: none
};

// Nothing if the program is done (after --help or --version).
Result<std::optional<HallOptions>> parse_hall_command_line(int argc, char** argv);

}  // namespace trocar::app
