#pragma once

// The processor time of a process.

#include <sys/types.h>
#include <unistd.h>

#include <sstream>
#include <string>

#include "tests/support/files.h"

namespace trocar::testing {

// CPU seconds of the thread that a process began with, which is the network's in servers and
// relays.
inline double cpu_seconds_of_first_thread(pid_t process) {
  const auto id = std::to_string(process);
  const auto text = load_text("/proc/" + id + "/task/" + id + "/stat");
  std::istringstream fields(text.substr(text.rfind(')') + 2));
  std::string field;
  double user = 0, system = 0;
  for (int i = 0; i < 11; ++i) fields >> field;
  fields >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

}  // namespace trocar::testing
