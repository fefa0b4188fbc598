#include "server/app/journal/run_program.h"

#include <unistd.h>

#include "common/process/process.h"

namespace trocar::app {

Status run_program(std::vector<std::string> words, const std::string& help) {
  const auto name = words.front();
  words.front() = process::find_program(name);
  auto child = process::Child::start({.words = std::move(words), .errors = STDERR_FILENO});
  if (!child) return Error{child.error().code, child.error().message + "; " + help};
  if (child->wait().exit_code == 0) return {};
  return Error{ErrorCode::ResourceMissing, name + ": has failed; " + help};
}

}  // namespace trocar::app
