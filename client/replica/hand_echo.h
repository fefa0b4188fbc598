#pragma once

// How long it takes from a hand to the picture: from when a reading of the first tool left until a
// frame shows the tool at that very position. Readings are looked up by position, so only a hand
// that moves is measured.

#include <cstdint>
#include <deque>
#include <optional>

#include "client/replica/session_view.h"

namespace trocar::replica {

class HandEcho {
 public:
  static constexpr std::size_t kMostSent = 1024;

  void note_sent(const Vec3f& position_m, std::uint64_t now_ns);
  // `shown_m`: where the newest frame with a state has the tool. Nothing if it has not moved since
  // the last call, or was not sent.
  std::optional<double> observe_ms(const Vec3f& shown_m, std::uint64_t now_ns);

 private:
  struct Sent {
    Vec3f position_m;
    std::uint64_t ns = 0;
  };
  std::deque<Sent> sent_;
  std::optional<Vec3f> last_shown_m_;
};

}  // namespace trocar::replica
