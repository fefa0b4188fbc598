#include "client/device/crash.h"

#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <ctime>

namespace trocar::device {
namespace {

// The first four come again with the instruction that caused them.
constexpr std::array kCrashSignals{SIGSEGV, SIGBUS,  SIGFPE,  SIGILL, SIGABRT,
                                   SIGSYS,  SIGQUIT, SIGXCPU, SIGPIPE};
constexpr std::size_t kFaults = 4;
constexpr long kCrashWaitNs = 10'000'000;

struct Words {
  std::atomic<bool> is_taken{false};
  std::atomic<int> socket{-1};  // -1: nothing is to be sent
  std::size_t size = 0;
  std::array<char, LastWords::kMostBytes> bytes{};
};

std::atomic<bool> crashing{false};
std::array<Words, LastWords::kMost> all_words;
std::array<struct sigaction, kCrashSignals.size()> handled_before;
// A thread whose stack is full could not run a handler on it.
alignas(16) std::array<std::byte, 16384> handler_stack;

static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free,
              "the handler may not wait for a lock");

void let_go_and_die(int signal, siginfo_t* info, void*) {
  crashing.store(true);
  for (Words& words : all_words) {
    const int socket = words.socket.load();
    if (socket < 0) continue;
    static_cast<void>(send(socket, words.bytes.data(), words.size, MSG_DONTWAIT | MSG_NOSIGNAL));
    // Another thread may be about to send a force: that does not follow.
    shutdown(socket, SHUT_WR);
  }
  const timespec wait{0, kCrashWaitNs};
  nanosleep(&wait, nullptr);
  bool is_fault = false;
  for (std::size_t i = 0; i < kCrashSignals.size(); ++i) {
    if (kCrashSignals[i] != signal) continue;
    sigaction(signal, &handled_before[i], nullptr);
    is_fault = i < kFaults && info->si_code > 0;
  }
  if (!is_fault) raise(signal);
}

}  // namespace

void install_crash_handlers() {
  stack_t stack{};
  stack.ss_sp = handler_stack.data();
  stack.ss_size = handler_stack.size();
  sigaltstack(&stack, nullptr);
  struct sigaction action {};
  action.sa_sigaction = let_go_and_die;
  action.sa_flags = SA_SIGINFO | SA_ONSTACK;
  sigemptyset(&action.sa_mask);
  for (std::size_t i = 0; i < kCrashSignals.size(); ++i)
    sigaction(kCrashSignals[i], &action, &handled_before[i]);
}

bool is_crashing() {
  return crashing.load(std::memory_order_relaxed);
}

LastWords::LastWords(int socket, std::string_view bytes) {
  if (bytes.size() > kMostBytes) return;
  for (std::size_t i = 0; i < kMost; ++i) {
    Words& words = all_words[i];
    if (words.is_taken.exchange(true)) continue;
    slot_ = i;
    std::ranges::copy(bytes, words.bytes.begin());
    words.size = bytes.size();
    words.socket.store(socket);
    return;
  }
}

LastWords::~LastWords() {
  if (slot_ == kMost) return;
  all_words[slot_].socket.store(-1);
  all_words[slot_].is_taken.store(false);
}

}  // namespace trocar::device
