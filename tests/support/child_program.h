#pragma once

// One of the project's programs as a child process.

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace trocar::testing {

// A running program; killed when it goes out of scope.
class Program {
 public:
  // `name` in build/<preset>/bin; output goes to `log`. Exit code 127 if it cannot be started.
  Program(const std::string& name, const std::vector<std::string>& arguments,
          const std::filesystem::path& log);
  Program(Program&& other) noexcept;
  Program& operator=(Program&&) = delete;
  ~Program();

  void signal(int number) const;
  // Exit code, 128 + signal if one ended it, or -1 after `seconds`.
  int wait(double seconds);
  bool is_running();
  pid_t process() const { return pid_; }

 private:
  pid_t pid_ = -1;
  int status_ = 0;
  bool has_ended_ = false;
};

}  // namespace trocar::testing
