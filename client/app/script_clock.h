#pragma once

// Simulated seconds since a script began, as its client knows them: frames say which tick it is,
// and between them time goes on as fast as it went from frame to frame lately, by at most one
// frame. So a script is the same on a server that cannot keep up, and on one that goes faster than
// real time. It knows no clock but what it is told. Never goes back.

#include <algorithm>
#include <cstdint>

#include "common/base/tick.h"

namespace trocar::app {

class ScriptClock {
 public:
  // The newest frame shows `newest` and came at `arrival_ns`; the first call begins the script.
  double seconds(Tick newest, std::uint64_t arrival_ns, std::uint64_t now_ns) {
    if (newest != newest_) note_frame(newest, arrival_ns);
    const auto since_ns = static_cast<double>(now_ns - std::min(now_ns, arrival_ns_));
    const auto ticks = static_cast<double>(newest - std::min(newest, begin_)) +
                       std::min(since_ns / tick_ns_, static_cast<double>(kTicksPerFrame));
    return seconds_ = std::max(seconds_, ticks / static_cast<double>(kTicksPerSecond));
  }

 private:
  void note_frame(Tick newest, std::uint64_t arrival_ns) {
    if (newest_ == 0) {
      begin_ = newest;
    } else if (newest > newest_ && arrival_ns > arrival_ns_) {
      const double ns =
          static_cast<double>(arrival_ns - arrival_ns_) / static_cast<double>(newest - newest_);
      // A session that was paused is no slower for it.
      tick_ns_ += kNewestShare * (std::min(ns, kMostSlower * tick_ns_) - tick_ns_);
    }
    newest_ = newest;
    arrival_ns_ = arrival_ns;
  }

  static constexpr double kNewestShare = 1.0 / 16, kMostSlower = 2;

  Tick begin_ = 0, newest_ = 0;
  std::uint64_t arrival_ns_ = 0;
  double tick_ns_ = static_cast<double>(kTickNanoseconds);  // of real time
  double seconds_ = 0;
};

}  // namespace trocar::app
