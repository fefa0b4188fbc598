#pragma once

// The server's clock as somebody else knows it, from pings: half of the shortest round trip of the
// last 16 is the best guess of the way there. Once there are 16 the guess is slewed, never stepped.

#include <cstdint>
#include <deque>

namespace trocar::wire {

class ServerClock {
 public:
  static constexpr std::size_t kSamples = 16;
  static constexpr double kSlewPerSecond = 0.0005;

  // All in us, of each side's own monotonic clock. A server that does not know its own says 0.
  void add(std::uint64_t sent_us, std::uint64_t server_us, std::uint64_t received_us);
  bool is_known() const { return !samples_.empty(); }
  // Server's time less this one's, in us.
  double offset_us() const { return offset_us_; }
  // The server's time at one of ours; 0: not known yet.
  std::uint64_t at(std::uint64_t now_us) const;
  double shortest_round_trip_us() const;

 private:
  struct Sample {
    double round_trip_us = 0, offset_us = 0;
  };
  std::deque<Sample> samples_;
  double offset_us_ = 0;
  std::uint64_t last_us_ = 0;
};

}  // namespace trocar::wire
