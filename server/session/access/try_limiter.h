#pragma once

// Bounds on how often wrong join codes may be tried, so that 40 bits of secret are enough.
//
//   per address   the first 5 wrong tries cost nothing; after the n-th one waits 2^(n-5) s, at most
//                 60 s, and what comes sooner is refused without a look at its code. Ten minutes
//                 without a wrong try make good for all.
//   in all        20 wrong tries in a second; then everybody waits for the next second.
//
// An IPv6 address counts as its /64 (counted_as()). At most 1024 addresses are
// kept; the one that has been quiet longest makes room.

#include <cstdint>
#include <map>
#include <string>

namespace trocar::access {

inline constexpr std::uint64_t kSecondNs = 1'000'000'000;

class TryLimiter {
 public:
  static constexpr int kFreeTries = 5;
  static constexpr std::uint64_t kLongestWaitSeconds = 60;
  static constexpr std::uint64_t kForgetSeconds = 600;
  static constexpr std::size_t kMostAddresses = 1024;
  static constexpr int kMostPerSecond = 20;

  // Seconds that this address has to wait, rounded up; 0: its code may be looked at.
  std::uint64_t seconds_to_wait(const std::string& address, std::uint64_t now_ns);
  void record_wrong_try(const std::string& address, std::uint64_t now_ns);

  std::size_t address_count() const { return addresses_.size(); }

 private:
  struct Record {
    int wrong_tries = 0;
    std::uint64_t last_ns = 0;     // of the last wrong try
    std::uint64_t allowed_ns = 0;  // when the next one may come
  };

  void forget_old(std::uint64_t now_ns);

  std::map<std::string, Record> addresses_;
  std::uint64_t second_begin_ns_ = 0;
  int wrong_in_second_ = 0;
};

}  // namespace trocar::access
