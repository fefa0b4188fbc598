// trocar-client: takes part in a session.

#include <cstdio>

#include "client/app/client.h"
#include "client/device/crash.h"
#include "client/device/device_list.h"
#include "common/base/log.h"
#include "common/base/program.h"
#include "common/discovery/finder.h"

namespace {

constexpr const char* kProgram = "trocar-client";
constexpr double kLookSeconds = 3;

int list_sessions(double seconds) {
  const auto found = trocar::discovery::find_sessions(seconds > 0 ? seconds : kLookSeconds);
  if (!found) return trocar::report(kProgram, found.error());
  std::fputs(trocar::discovery::to_table(*found).c_str(), stdout);
  return static_cast<int>(trocar::ExitCode::Ok);
}

}  // namespace

int main(int argc, char** argv) {
  trocar::begin_program(kProgram);
  const auto options = trocar::app::parse_client_command_line(argc, argv);
  if (!options) return trocar::report(kProgram, options.error());
  if (!*options) return static_cast<int>(trocar::ExitCode::Ok);
  if (const auto set = trocar::log::configure(kProgram, (*options)->log_level); !set)
    return trocar::report(kProgram, set.error());
  if ((*options)->lists_sessions) return list_sessions((*options)->seconds);
  if ((*options)->lists_devices) {
    std::fputs(trocar::device::device_table(trocar::device::list_devices()).c_str(), stdout);
    return static_cast<int>(trocar::ExitCode::Ok);
  }
  trocar::app::install_signal_handlers();
  trocar::device::install_crash_handlers();
  const auto run = trocar::app::run_client(**options);
  if (!run) return trocar::report(kProgram, run.error());
  return static_cast<int>(*run);
}
