#pragma once

// How many frames may be under way to one client at a time, by one path. A slow link keeps what it
// cannot carry in queues that nobody here sees, and every picture in them grows old; but
// acknowledgements show how late frames arrive. While they come as fast as over the idle link the
// window grows by one frame per window; when they are late, or less late but some are lost, it
// halves, down to one frame at a time. (The rule of LEDBAT, RFC 6817, in frames.) Losses without
// delay change nothing: a radio link loses what it likes.
//
// Times are of one monotonic clock, in ns. Frames are told in ascending order.

#include <cstdint>
#include <deque>

#include "common/base/tick.h"

namespace trocar::pacing {

class FramePacer {
 public:
  static constexpr double kMostFrames = 64, kFirstFrames = 16;
  // A client answers within a frame or two, however short the queue.
  static constexpr std::uint64_t kEarlyNs = 35'000'000, kLateNs = 60'000'000;

  void on_sent(Frame frame, std::uint64_t now_ns);
  // Also acknowledges all earlier ones. `frame` may have gone by another path.
  void on_acknowledged(Frame frame, std::uint64_t now_ns);
  // True if another frame may leave. When nothing is heard for a while one frame tries again, and
  // the while doubles each time.
  bool may_send(std::uint64_t now_ns) const;

  // One frame at a time is always late, and most are lost; or of many none has arrived for long:
  // what is sent this way stays too much.
  bool is_congested(std::uint64_t now_ns) const;
  // Begins anew, carefully.
  void restart();

  double window() const { return window_; }
  std::size_t under_way() const { return sent_.size(); }
  // From sending to acknowledgement: the shortest of the last 10 to 20 s, and the last; 0: unknown.
  std::uint64_t shortest_ns() const;
  std::uint64_t last_ns() const { return last_ns_; }

 private:
  struct Sent {
    Frame frame = 0;
    std::uint64_t ns = 0;
  };

  bool has_room() const;
  void learn(std::uint64_t elapsed_ns, std::uint64_t now_ns);
  void adapt(double acknowledged, Frame frame);

  std::deque<Sent> sent_;  // not acknowledged, ascending
  double window_ = kFirstFrames;
  double arriving_ = 1;  // share of frames lately
  int tries_ = 0;        // beyond the window, since something was heard
  int late_in_a_row_ = 0;
  Frame narrowed_at_ = 0;  // frames up to this left before the window was narrowed
  std::uint64_t last_ns_ = 0;
  std::uint64_t shortest_[2] = {0, 0};  // of this period of 10 s, and of the one before
  std::uint64_t period_begin_ns_ = 0;
};

}  // namespace trocar::pacing
