#pragma once

// The life of a program that serves, the same for all of them: the command line, the log, a look at
// the configuration where it is asked for, and the service itself. Options have log_level,
// log_format, checks_config and config_file; those with origins say where an option came from.

#include <cstdio>
#include <optional>
#include <string>

#include "common/base/exit_code.h"
#include "common/base/json_log.h"
#include "common/base/log.h"
#include "common/base/program.h"
#include "common/base/result.h"
#include "common/base/signals.h"

namespace trocar::app {

template <typename Options>
struct Service {
  const char* name;
  Result<std::optional<Options>> (*parse)(int argc, char** argv);  // nothing: it is done
  Status (*check)(const Options&);  // whatever is wrong is an error of usage
  Status (*run)(const Options&);
};

// Returns the program's exit code.
template <typename Options>
int run_service(const Service<Options>& service, int argc, char** argv) {
  begin_program(service.name);
  ignore_broken_pipes();
  const auto parsed = service.parse(argc, argv);
  if (!parsed) return report(service.name, parsed.error());
  if (!*parsed) return static_cast<int>(ExitCode::Ok);
  const Options& options = **parsed;
  if (const auto set =
          log::configure(service.name, options.checks_config ? "off" : options.log_level);
      !set)
    return report(service.name, set.error());
  log::use_format(options.log_format);
  auto done = options.checks_config ? service.check(options) : service.run(options);
  if (done) {
    if (options.checks_config) std::printf("%s: fine\n", options.config_file.c_str());
    return static_cast<int>(ExitCode::Ok);
  }
  Error error = done.error();
  if (options.checks_config) error.code = ErrorCode::Usage;
  if constexpr (requires { options.origins; })
    error.message = options.origins.placed(error.message);
  return report(service.name, error);
}

}  // namespace trocar::app
