#include "server/app/web/check_process.h"

#include <unistd.h>

#include <utility>

namespace trocar::app {
namespace {

constexpr std::size_t kMostOutput = 64 * 1024;

}  // namespace

Result<CheckProcess> CheckProcess::start(const std::filesystem::path& journal_program,
                                         int recording) {
  if (::access(journal_program.c_str(), X_OK) != 0)
    return Error{ErrorCode::ResourceMissing,
                 "trocar-journal is not beside trocar-web: it checks recordings"};
  process::MemoryFile output, errors;
  auto child =
      process::Child::start({.words = {"setpriv", "--pdeathsig", "KILL", "nice", "-n", "19",
                                       "prlimit", "--as=4294967296", "--core=0", "--fsize=65536",
                                       journal_program, "verify", "/proc/self/fd/3", "--json"},
                             .out = output.descriptor(),
                             .errors = errors.descriptor(),
                             .more = recording});
  if (!child) return child.error();
  return CheckProcess(std::move(*child), std::move(output), std::move(errors));
}

std::optional<CheckProcess::Outcome> CheckProcess::poll() {
  const auto ending = child_.poll();
  if (!ending) return std::nullopt;
  return Outcome{ending->exit_code, output_.text(kMostOutput), errors_.text(kMostOutput)};
}

}  // namespace trocar::app
