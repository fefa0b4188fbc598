#pragma once

// One of the project's programs as a child process.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/process/process.h"

namespace trocar::testing {

// A running program; killed when it goes out of scope.
class Program {
 public:
  // `name` in build/<preset>/bin; output goes to `log`. Exit code 127 if it cannot be started.
  Program(const std::string& name, const std::vector<std::string>& arguments,
          const std::filesystem::path& log);

  void signal(int number) const { child_->signal(number); }
  // Exit code, 128 + signal if one ended it, or -1 after `seconds`.
  int wait(double seconds);
  bool is_running() { return child_ && !child_->poll(); }
  pid_t process() const { return child_->pid(); }

 private:
  std::optional<process::Child> child_;  // nothing: it cannot be started
};

}  // namespace trocar::testing
