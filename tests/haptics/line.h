#pragma once

// A line between a client and its server in simulated time. Each message is late, and is lost or
// comes on its own, as datagrams do; over a stream none is lost, but it waits for its repetition,
// and all that were sent after it wait with it.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

namespace trocar::haptics::testing {

struct Line {
  double rtt_s = 0.05;
  double loss = 0.01;
  double jitter_s = -1;  // below 0: 2 % of the way and 0.2 ms
  double patch_hz = 62.5, reading_hz = 250;
  bool is_stream = false;
};

template <typename Message>
class Channel {
 public:
  // rate_hz: of its messages. Three that come after a lost one make a stream repeat it.
  Channel(const Line& line, double rate_hz, std::uint64_t seed)
      : line_(line), repeat_s_(line.rtt_s + 3 / rate_hz), random_(seed) {
    if (line_.jitter_s < 0) line_.jitter_s = 0.02 * line_.rtt_s + 0.0002;
  }
  void send(double now_s, const Message& message) {
    double delay_s = line_.rtt_s / 2 +
                     line_.jitter_s * -std::log(1 - std::generate_canonical<double, 53>(random_));
    const bool is_lost = std::generate_canonical<double, 53>(random_) < line_.loss;
    if (line_.is_stream) {
      if (is_lost) delay_s += repeat_s_;
      last_s_ = std::max(last_s_, now_s + delay_s);
      under_way_.push_back({last_s_, message});
    } else if (!is_lost) {
      under_way_.push_back({now_s + delay_s, message});
    }
  }
  // In the order in which they were sent.
  template <typename Take>
  void deliver(double now_s, const Take& take) {
    auto kept = under_way_.begin();
    for (const auto& each : under_way_) {
      if (each.first > now_s)
        *kept++ = each;
      else
        take(each.second);
    }
    under_way_.erase(kept, under_way_.end());
  }

 private:
  Line line_;
  double repeat_s_, last_s_ = 0;
  std::mt19937_64 random_;
  std::vector<std::pair<double, Message>> under_way_;
};

}  // namespace trocar::haptics::testing
