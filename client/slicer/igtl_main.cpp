// trocar-igtl: a session for 3D Slicer and other programs that speak OpenIGTLink.

#include "client/slicer/link.h"
#include "client/slicer/options.h"
#include "common/base/log.h"
#include "common/base/program.h"
#include "common/base/signals.h"

int main(int argc, char** argv) {
  constexpr const char* kProgram = "trocar-igtl";
  trocar::begin_program(kProgram);
  trocar::ignore_broken_pipes();
  const auto options = trocar::slicer::parse_link_command_line(argc, argv);
  if (!options) return trocar::report(kProgram, options.error());
  if (!*options) return static_cast<int>(trocar::ExitCode::Ok);
  if (const auto set = trocar::log::configure(kProgram, (*options)->log_level); !set)
    return trocar::report(kProgram, set.error());
  const auto run = trocar::slicer::run_link(**options);
  return run ? static_cast<int>(*run) : trocar::report(kProgram, run.error());
}
