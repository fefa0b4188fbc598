#pragma once

// One run of "trocar-journal verify --json" over a file that is open. It has the lowest priority,
// no file of this program but that one, 4 GiB of memory, and ends with this object and with this
// program. Its output goes to memory, 64 KiB of it count. Thread: that which started it.

#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "common/base/result.h"
#include "common/process/memory_file.h"
#include "common/process/process.h"

namespace trocar::app {

class CheckProcess {
 public:
  struct Outcome {
    std::optional<int> exit_code;  // nothing: a signal has ended it
    std::string output, errors;
  };

  // `recording`: its descriptor. Error: there is no such program, or no process.
  static Result<CheckProcess> start(const std::filesystem::path& journal_program, int recording);

  // Nothing while it runs; does not wait.
  std::optional<Outcome> poll();

 private:
  CheckProcess(process::Child child, process::MemoryFile output, process::MemoryFile errors)
      : child_(std::move(child)), output_(std::move(output)), errors_(std::move(errors)) {}

  process::Child child_;
  process::MemoryFile output_, errors_;
};

}  // namespace trocar::app
