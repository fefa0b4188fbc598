#include "common/base/signals.h"

#include <signal.h>

namespace trocar {

void ignore_broken_pipes() {
  ::signal(SIGPIPE, SIG_IGN);
}

std::vector<int> ending_signals() {
  std::vector<int> signals{SIGINT, SIGTERM};
  struct sigaction now {};
  const bool is_ignored = ::sigaction(SIGHUP, nullptr, &now) == 0 && now.sa_handler == SIG_IGN;
  if (!is_ignored) signals.push_back(SIGHUP);
  return signals;
}

const char* name_of_signal(int signal) {
  return signal == SIGINT ? "Ctrl-C" : signal == SIGHUP ? "SIGHUP" : "SIGTERM";
}

}  // namespace trocar
