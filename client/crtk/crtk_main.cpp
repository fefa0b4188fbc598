// trocar-crtk: arms of a robot as instruments of a session, moved by CRTK over DDS.

#include "client/crtk/crtk.h"
#include "common/base/log.h"
#include "common/base/program.h"

int main(int argc, char** argv) {
  constexpr const char* kProgram = "trocar-crtk";
  trocar::begin_program(kProgram);
  const auto options = trocar::crtk::parse_crtk_command_line(argc, argv);
  if (!options) return trocar::report(kProgram, options.error());
  if (!*options) return static_cast<int>(trocar::ExitCode::Ok);
  if (const auto set = trocar::log::configure(kProgram, (*options)->log_level); !set)
    return trocar::report(kProgram, set.error());
  trocar::crtk::install_signal_handlers();
  const auto run = trocar::crtk::run_crtk(**options);
  if (!run) return trocar::report(kProgram, run.error());
  return static_cast<int>(*run);
}
