#pragma once

// How long it takes from a hand to the picture: from when a reading of the first tool left until a
// frame shows the tool there. Frames show it between readings, so the place is looked for on the
// line through those of the last seconds. A hand that goes to and fro was there more than once: the
// time nearest to the one at which it is likely to have left is meant. Only a hand that moves is
// measured.

#include <cstdint>
#include <deque>
#include <optional>

#include "client/replica/session_view.h"

namespace trocar::replica {

class HandEcho {
 public:
  static constexpr std::uint64_t kKeptNs = 4'000'000'000;
  static constexpr float kNear_m = 1e-4f;          // of the line; else it was pushed aside
  static constexpr float kLeastSpeed_m_s = 0.01f;  // of the hand there

  void note_sent(const Vec3f& position_m, std::uint64_t now_ns);
  // `shown_m`: where the newest frame with a state has the tool. `likely_ns`: when what that frame
  // shows is likely to have left. Nothing if the tool rests there, or was never near.
  std::optional<double> observe_ms(const Vec3f& shown_m, std::uint64_t likely_ns,
                                   std::uint64_t now_ns);

 private:
  struct Sent {
    Vec3f position_m;
    std::uint64_t ns = 0;
  };
  std::deque<Sent> sent_;
  std::optional<Vec3f> last_shown_m_;
};

}  // namespace trocar::replica
