#include "common/base/signals.h"

#include <signal.h>
#include <unistd.h>

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

void ignore_ending_signals(unsigned seconds) {
  ::signal(SIGALRM, [](int) {
    for (const int signal : {SIGINT, SIGTERM}) ::signal(signal, SIG_DFL);
  });
  ::alarm(seconds);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ::signal(signal, SIG_IGN);
}

const char* name_of_signal(int signal) {
  return signal == SIGINT ? "Ctrl-C" : signal == SIGHUP ? "SIGHUP" : "SIGTERM";
}

}  // namespace trocar
