// trocar-server: hosts one session.

#include <cstdio>

#include "common/base/json_log.h"
#include "common/base/log.h"
#include "common/base/program.h"
#include "common/base/signals.h"
#include "common/base/time_slice.h"
#include "server/app/server/check_start.h"
#include "server/app/server/options.h"
#include "server/app/server/server.h"

namespace {

constexpr const char* kProgram = "trocar-server";

// Whatever is wrong with a configuration is an error of usage here.
int check_config(const trocar::app::ServerOptions& options) {
  if (const auto fine = trocar::app::check_start(options); !fine)
    return trocar::report(kProgram, {trocar::ErrorCode::Usage, fine.error().message});
  std::printf("%s: fine\n", options.config_file.c_str());
  return static_cast<int>(trocar::ExitCode::Ok);
}

}  // namespace

int main(int argc, char** argv) {
  trocar::begin_program(kProgram);
  trocar::ignore_broken_pipes();
  const auto parsed = trocar::app::parse_command_line(argc, argv);
  if (!parsed) return trocar::report(kProgram, parsed.error());
  if (!*parsed) return static_cast<int>(trocar::ExitCode::Ok);
  const auto& options = **parsed;
  const auto level = options.checks_config ? std::string("off") : options.log_level;
  if (const auto set = trocar::log::configure(kProgram, level); !set)
    return trocar::report(kProgram, set.error());
  trocar::log::use_format(options.log_format);
  if (options.checks_config) return check_config(options);
  trocar::ask_for_short_slices();  // and for all threads that are started from here on
  if (const auto run = trocar::app::run_server(options); !run)
    return trocar::report(kProgram,
                          {run.error().code, options.origins.placed(run.error().message)});
  return static_cast<int>(trocar::ExitCode::Ok);
}
