#pragma once

// trocar-server's command line, and the configuration file that it may name.

#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/lesson/lesson.h"
#include "server/app/config/option_origins.h"
#include "server/app/server/access_options.h"
#include "server/app/server/limit_options.h"
#include "server/tissue/step/tick_report.h"
#include "server/tissue/thread/rules.h"

namespace trocar::app {

struct ServerOptions {
  std::string organ = "liver";
  bool is_organ_chosen = false;             // on the command line
  std::string lesson_file;                  // empty: none
  std::optional<lesson::Lesson> lesson;     // read from it
  bool bleeds = false;                      // asked for, besides what a lesson says
  std::string threads_file;                 // empty: none
  std::optional<thread::Rules> threads;     // read from it
  std::string resume_file;                  // empty: a new session
  std::optional<bool> has_averaged_strain;  // empty: as the organ has it
  std::string address = "127.0.0.1";
  std::uint16_t port = 7690;
  bool is_stream_only = false;  // no datagrams
  std::string metrics_address;  // empty: no figures for monitoring
  std::uint16_t metrics_port = 0;
  bool has_page = false;     // trocar-web beside it, for this session
  std::string page_address;  // where browsers reach that; empty: as the server's own
  std::uint16_t page_port = 7691;
  bool is_agones = false;  // a sidecar of Agones listens on this machine
  AccessOptions access;
  LimitOptions limits;
  std::string announced_name;      // on the local network; empty: made from organ and machine
  bool is_unannounced = false;     // otherwise it is announced where others may reach it
  std::string journal;             // a file, or "none"
  std::string signing_key_file;    // of the recording; empty: it is not signed
  double seconds = 0;              // simulated; 0: until told to end
  double pace = 1;                 // of real time at most, while hands follow
  std::size_t awaited_people = 0;  // time begins when so many are there
  std::string summary_file;        // empty: none
  std::string ready_file;          // empty: none
  step::TickDecisions decisions;   // fixed, or the most that the rate controller decides
  bool are_sweeps_chosen = false;  // else as many as the organ needs
  bool has_fixed_decisions = false;
  double budget_ms = 0.8;  // of a tick's millisecond for its work
  unsigned workers = 0;    // threads that share a tick's work; 0: as many as help
  std::string log_level = "info", log_format = "text";
  std::string config_file;     // empty: none
  bool checks_config = false;  // instead of hosting a session
  OptionOrigins origins;
};

// Nothing if the program is done (after --help or --version).
Result<std::optional<ServerOptions>> parse_command_line(int argc, char** argv);

// "ADDR:PORT" or "[IPV6]:PORT"; the port may be 0 (any free one).
Status parse_listen_address(const std::string& text, ServerOptions& options);
// Reads --browser-listen likewise, an empty text is the server's address and port 7691.
Status parse_page_address(const std::string& text, ServerOptions& options);
// Reads --metrics likewise; an empty text is none.
Status parse_metrics_address(const std::string& text, ServerOptions& options);

}  // namespace trocar::app
