#include "common/wire/server_clock.h"

#include <algorithm>
#include <cmath>

namespace trocar::wire {

void ServerClock::add(std::uint64_t sent_us, std::uint64_t server_us, std::uint64_t received_us) {
  if (received_us < sent_us || server_us == 0) return;
  const auto round_trip = static_cast<double>(received_us - sent_us);
  const double middle = static_cast<double>(sent_us) + round_trip / 2;
  const bool is_settled = samples_.size() >= kSamples;
  samples_.push_back({round_trip, static_cast<double>(server_us) - middle});
  if (samples_.size() > kSamples) samples_.pop_front();
  const double target = std::ranges::min(samples_, {}, &Sample::round_trip_us).offset_us;
  const double most = kSlewPerSecond * static_cast<double>(received_us - last_us_);
  offset_us_ = is_settled ? offset_us_ + std::clamp(target - offset_us_, -most, most) : target;
  last_us_ = received_us;
}

std::uint64_t ServerClock::at(std::uint64_t now_us) const {
  return is_known() ? now_us + static_cast<std::uint64_t>(std::llround(offset_us_)) : 0;
}

double ServerClock::shortest_round_trip_us() const {
  return samples_.empty() ? 0
                          : std::ranges::min(samples_, {}, &Sample::round_trip_us).round_trip_us;
}

}  // namespace trocar::wire
