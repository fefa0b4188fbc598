#pragma once

// Signals of programs that run for long and end in order.

#include <vector>

namespace trocar {

// Writing where nobody reads any more is an error of that write from now on, not the end of the
// program (SIGPIPE). Programs that this one starts inherit it.
void ignore_broken_pipes();

// Returns the signals that ask for an end in order: SIGINT, SIGTERM and SIGHUP, which comes when
// the terminal is closed. SIGHUP is not among them if it is ignored, as nohup has it.
std::vector<int> ending_signals();

// From now on these signals do nothing, so that an end in order is not cut short by the next one;
// after so many seconds they end the program at once, should its end hang. A signal handler may
// call it.
inline constexpr unsigned kEndSeconds = 30;
void ignore_ending_signals(unsigned seconds = kEndSeconds);

// Returns how people know one of them: "Ctrl-C", "SIGTERM" or "SIGHUP".
const char* name_of_signal(int signal);

}  // namespace trocar
