#pragma once

// A program that crashes lets go of the hands before it dies. It can trust neither its memory nor
// its locks then, so the handler of the signal does only what POSIX allows there
// (signal-safety(7)):
//
//   1 a flag goes up: from now on DeviceExchange orders no force
//   2 each connection that has left its last words here is sent them, and closed for writing
//   3 it waits for 10 ms: the threads that talk to devices still run, and write no force
//   4 the signal does what it does without a handler
//
// A maker's function is never called: it may wait for a lock that the crashed thread holds. So the
// device of a thread that has itself crashed is left to its watchdog, as is every one on SIGKILL.

#include <cstddef>
#include <string_view>

namespace trocar::device {

// Handles signals that end a program at once: faults, SIGABRT, SIGSYS, SIGQUIT, SIGXCPU, SIGPIPE.
void install_crash_handlers();
// Any thread.
bool is_crashing();

// Bytes that a socket is sent if the program crashes, as long as this lives. At most kMost at a
// time are kept, and kMostBytes each; one that does not fit is left out. The socket outlives it.
class LastWords {
 public:
  static constexpr std::size_t kMost = 4, kMostBytes = 1024;

  LastWords(int socket, std::string_view bytes);
  ~LastWords();
  LastWords(const LastWords&) = delete;
  LastWords& operator=(const LastWords&) = delete;

 private:
  std::size_t slot_ = kMost;  // kMost: it was left out
};

}  // namespace trocar::device
