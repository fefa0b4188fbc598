#pragma once

// A server's clock as seen from here, by pings: half of the shortest of the last 16 round trips is
// taken as the way there. Times in us, ours of a monotonic clock.

#include <algorithm>
#include <cstdint>
#include <deque>

namespace trocar::follow {

class ServerClock {
 public:
  void note(std::uint64_t sent_us, std::uint64_t received_us, std::uint64_t server_us) {
    if (received_us < sent_us || server_us == 0) return;
    const auto trip = received_us - sent_us;
    trips_.push_back({trip, static_cast<std::int64_t>(server_us) -
                                static_cast<std::int64_t>(sent_us + trip / 2)});
    if (trips_.size() > kTrips) trips_.pop_front();
  }
  // 0: not known yet.
  std::uint64_t at(std::uint64_t now_us) const {
    if (trips_.empty()) return 0;
    const auto best = std::ranges::min_element(trips_, {}, &Trip::us);
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(now_us) + best->offset_us);
  }

 private:
  static constexpr std::size_t kTrips = 16;
  struct Trip {
    std::uint64_t us = 0;
    std::int64_t offset_us = 0;
  };
  std::deque<Trip> trips_;
};

}  // namespace trocar::follow
