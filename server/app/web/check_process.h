#pragma once

// One run of "trocar-journal verify --json" over a file that is open. It has the lowest priority,
// no file of this program but that one, 4 GiB of memory, and ends with this program. Its output
// goes to memory, 64 KiB of it count. Thread: that which started it.

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>

#include "common/base/result.h"

namespace trocar::app {

class CheckProcess {
 public:
  struct Outcome {
    int exit_code = 0;  // -1: a signal ended it
    std::string output, errors;
  };

  // `recording`: its descriptor. Error: there is no such program, or no process.
  static Result<CheckProcess> start(const std::filesystem::path& journal_program, int recording);
  CheckProcess(CheckProcess&& other) noexcept;
  CheckProcess& operator=(CheckProcess&&) = delete;
  ~CheckProcess();  // ends it

  // Nothing while it runs; does not wait.
  std::optional<Outcome> poll();

 private:
  CheckProcess(pid_t pid, int output, int errors) : pid_(pid), output_(output), errors_(errors) {}

  pid_t pid_ = -1;
  int output_ = -1, errors_ = -1;
};

}  // namespace trocar::app
