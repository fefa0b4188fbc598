// trocar-relay: passes a session on to many who watch.

#include <cstdio>

#include "common/base/json_log.h"
#include "common/base/log.h"
#include "common/base/program.h"
#include "common/base/signals.h"
#include "server/app/relay/relay_server.h"

namespace trocar::app {
namespace {

constexpr const char* kProgram = "trocar-relay";

int run(int argc, char** argv) {
  const auto parsed = parse_relay_command_line(argc, argv);
  if (!parsed) return report(kProgram, parsed.error());
  if (!*parsed) return static_cast<int>(ExitCode::Ok);
  const auto& options = **parsed;
  if (const auto set = log::configure(kProgram, options.checks_config ? "off" : options.log_level);
      !set)
    return report(kProgram, set.error());
  log::use_format(options.log_format);
  if (options.checks_config) {
    if (const auto fine = check_relay(options); !fine)
      return report(kProgram, {ErrorCode::Usage, options.origins.placed(fine.error().message)});
    std::printf("%s: fine\n", options.config_file.c_str());
    return static_cast<int>(ExitCode::Ok);
  }
  if (const auto ran = run_relay(options); !ran)
    return report(kProgram, {ran.error().code, options.origins.placed(ran.error().message)});
  return static_cast<int>(ExitCode::Ok);
}

}  // namespace
}  // namespace trocar::app

int main(int argc, char** argv) {
  trocar::begin_program(trocar::app::kProgram);
  trocar::ignore_broken_pipes();
  return trocar::app::run(argc, argv);
}
