#pragma once

// The way back into a session whose connection broke: until when there is one, how long to wait
// before each try, and how long the session was away.
//
//   allow (Welcome) --> begin (the connection broke) --> next_pause, a try, ... --> end (Welcome)
//                                                                 \-> is_over: lost
//
// Times are monotonic_ns(). Thread: the Asio thread; figures() and is_away() any.

#include <atomic>
#include <cstdint>
#include <string>

#include "common/base/backoff.h"

namespace trocar::net {

class Comeback {
 public:
  static constexpr std::chrono::milliseconds kFirstPause{200}, kLongestPause{2000};

  // Takes what Welcome says: an empty token, or no time, means that there is no way back.
  void allow(const std::string& token, std::uint32_t kept_seconds);
  bool is_allowed() const { return kept_ns_ > 0; }
  const std::string& token() const { return token_; }

  // Has no effect while away: a try that failed does not make the time longer.
  void begin(std::uint64_t now_ns);
  void end(std::uint64_t now_ns);
  bool is_over(std::uint64_t now_ns) const { return now_ns >= deadline_ns_; }
  std::uint64_t deadline_ns() const { return deadline_ns_; }
  // None goes beyond the deadline.
  std::chrono::nanoseconds next_pause(std::uint64_t now_ns);

  struct Figures {
    std::uint64_t returns = 0;
    double longest_seconds = 0;                 // of all absences, with the present one
    double away_seconds = 0, left_seconds = 0;  // of the present one
  };
  bool is_away() const { return away_since_ns_ != 0; }
  Figures figures(std::uint64_t now_ns) const;

 private:
  std::string token_;
  std::uint64_t kept_ns_ = 0;
  Backoff pause_{kFirstPause, kLongestPause, 1.5};
  std::atomic<std::uint64_t> away_since_ns_{0}, deadline_ns_{0};  // 0: not away
  std::atomic<std::uint64_t> returns_{0}, longest_ns_{0};
};

}  // namespace trocar::net
