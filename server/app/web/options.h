#pragma once

// trocar-web's command line, and the configuration file that it may name.

#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/app/config/option_origins.h"
#include "server/watch/follow/sessions.h"

namespace trocar::app {

// People practise alone, in sessions of a hall.
struct PracticeOptions {
  std::string offer;  // of the hall; empty: nobody practises
  std::string hall_host = "127.0.0.1";
  std::uint16_t hall_port = 7694;
  std::string key_file = "hall.key";
  int minutes = 30;  // of one session at most
  int idle_s = 180;  // without a deed, and it ends
};

struct WebOptions {
  std::string address = "127.0.0.1";
  std::uint16_t port = 7691;
  std::vector<follow::SessionAddress> sessions;
  std::string recordings_folder;  // empty: none
  std::string page_folder;        // empty: beside the program
  PracticeOptions practice;
  std::string metrics_address;  // empty: no figures
  std::uint16_t metrics_port = 0;
  std::string public_name;  // HOST[:PORT] in links; empty: the address
  std::string state_folder, certificate_file, key_file;
  bool is_insecure = false;
  bool draws_codes = false;  // QR codes of the links, wherever they are printed
  bool makes_new_key = false;
  int most_connections = 600, most_per_address = 200;
  int check_limit_s = 3600;  // of one recording's check
  double seconds = 0;        // 0: until told to end
  std::string ready_file;
  std::string log_level = "info", log_format = "text";
  bool checks_config = false;
  std::string config_file;
  OptionOrigins origins;
};

// Nothing if the program is done (after --help or --version).
Result<std::optional<WebOptions>> parse_web_command_line(int argc, char** argv);

}  // namespace trocar::app
