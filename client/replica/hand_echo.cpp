#include "client/replica/hand_echo.h"

#include <algorithm>

namespace trocar::replica {

void HandEcho::note_sent(const Vec3f& position_m, std::uint64_t now_ns) {
  if (!sent_.empty() && sent_.back().position_m == position_m) return;  // it rests
  sent_.push_back({position_m, now_ns});
  if (sent_.size() > kMostSent) sent_.pop_front();
}

std::optional<double> HandEcho::observe_ms(const Vec3f& shown_m, std::uint64_t now_ns) {
  if (last_shown_m_ && *last_shown_m_ == shown_m) return std::nullopt;
  last_shown_m_ = shown_m;
  const auto found = std::ranges::find(sent_, shown_m, &Sent::position_m);
  if (found == sent_.end()) return std::nullopt;
  const auto elapsed_ns = now_ns - found->ns;
  sent_.erase(sent_.begin(), found + 1);
  return static_cast<double>(elapsed_ns) * 1e-6;
}

}  // namespace trocar::replica
