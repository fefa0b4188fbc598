#pragma once

// Other programs as children of this one. Their arguments go as they are, without a shell. A child
// has the files that its command names and no other of ours; no signal is blocked in it, and a
// broken pipe ends it.
//
// The kernel's other settings are a matter of programs that go before the words of a command:
// "setpriv --pdeathsig", "nice", "prlimit".
//
// Thread: that which started it.

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace trocar::process {

inline constexpr int kNothing = -1;

struct Command {
  // The program, and its arguments. A name without a slash is looked for on the path.
  std::vector<std::string> words;
  // Descriptors of ours that become its streams; kNothing: /dev/null.
  int in = kNothing, out = kNothing, errors = kNothing;
  int more = kNothing;        // a descriptor of ours that becomes its descriptor 3
  std::filesystem::path log;  // takes output and errors at its end, of mode 0600; empty: none
  bool is_apart = false;      // in a session of its own, which our terminal does not end
};

struct Ending {
  std::optional<int> exit_code;  // nothing: a signal has ended it, or nobody knows
  int signal = 0;                // 0: none, or unknown
};

class Child {
 public:
  // Error (ResourceMissing): "PROGRAM: cannot be started (REASON)".
  static Result<Child> start(const Command& command);
  Child(Child&& other) noexcept;
  Child& operator=(Child&& other) noexcept;
  ~Child();  // kills it if it runs

  pid_t pid() const { return pid_; }
  // Nothing while it runs; does not wait.
  std::optional<Ending> poll();
  Ending wait();
  // It never reaches another process, not even once this one has ended.
  void signal(int number) const;
  // Asks it to end (SIGTERM), and kills it if it has not ended after `grace`.
  void stop(std::chrono::milliseconds grace);
  // From then on it goes on by itself.
  void leave() { pid_ = 0; }

 private:
  explicit Child(pid_t pid) : pid_(pid) {}
  void look(int options);

  pid_t pid_;  // 0: left, or moved from
  std::optional<Ending> ending_;
};

// Returns the path of one of our programs: beside this one, or else its name, for the path.
std::string find_program(const std::string& name);

// Goes on as another program, in this process. Returns why it cannot.
Error become(const std::vector<std::string>& words);

}  // namespace trocar::process
