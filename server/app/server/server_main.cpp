// trocar-server: hosts one session.

#include "common/base/cpu.h"
#include "common/base/log.h"
#include "server/app/server/options.h"
#include "server/app/server/server.h"

int main(int argc, char** argv) {
  constexpr const char* kProgram = "trocar-server";
  trocar::require_cpu_features(kProgram);
  const auto options = trocar::app::parse_command_line(argc, argv);
  if (!options) return trocar::report(kProgram, options.error());
  if (!*options) return static_cast<int>(trocar::ExitCode::Ok);
  if (const auto set = trocar::log::configure(kProgram, (*options)->log_level); !set)
    return trocar::report(kProgram, set.error());
  if (const auto run = trocar::app::run_server(**options); !run)
    return trocar::report(kProgram, run.error());
  return static_cast<int>(trocar::ExitCode::Ok);
}
