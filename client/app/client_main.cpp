// trocar-client: takes part in a session.

#include "client/app/client.h"
#include "common/base/cpu.h"
#include "common/base/log.h"

int main(int argc, char** argv) {
  constexpr const char* kProgram = "trocar-client";
  trocar::require_cpu_features(kProgram);
  const auto options = trocar::app::parse_client_command_line(argc, argv);
  if (!options) return trocar::report(kProgram, options.error());
  if (!*options) return static_cast<int>(trocar::ExitCode::Ok);
  if (const auto set = trocar::log::configure(kProgram, (*options)->log_level); !set)
    return trocar::report(kProgram, set.error());
  trocar::app::install_signal_handlers();
  const auto run = trocar::app::run_client(**options);
  if (!run) return trocar::report(kProgram, run.error());
  return static_cast<int>(*run);
}
