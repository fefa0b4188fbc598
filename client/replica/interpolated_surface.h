#pragma once

// The surface to show now: float positions and tools between two published frames are computed
// here.
//
// Frames arrive every 16 ms with jitter; the display runs about 1.5 frames (24 ticks) behind the
// newest, so that there nearly always is a frame on either side. The display tick follows
//   target = newest tick - 24 + (time since its arrival) x rate,   at most the newest tick,
// where `rate` (ticks per second) is measured over the last half second of arrivals: simulated time
// may run slower than real time, a replay at any speed. It is slewed, never stepped back; after a
// seek or a gap of more than 250 ticks it jumps. Nothing is extrapolated: at the newest frame the
// picture holds still. After a return to the session (Replica::welcome_count) the tissue glides
// from where it was shown last to where it is, in 0.3 s. Thread: render thread.

#include <deque>

#include "client/replica/replica.h"

namespace trocar::replica {

inline constexpr double kDisplayDelayTicks = 24;

// Estimates the display tick from arrivals. Separate from the surface so that it can be tested
// alone.
class DisplayClock {
 public:
  void restart();
  // Takes each frame once, in order.
  void add_arrival(Tick tick, std::uint64_t arrival_ns);
  // Advances to `now_ns` and returns the display tick; monotone between restarts.
  double advance(std::uint64_t now_ns);

 private:
  struct Arrival {
    Tick tick;
    std::uint64_t ns;
  };
  double rate() const;  // ticks per second

  std::deque<Arrival> arrivals_;
  double display_tick_ = -1;  // < 0: not started
  std::uint64_t last_ns_ = 0;
};

class InterpolatedSurface {
 public:
  // Takes in new frames of `replica` and computes the picture at `now_ns` (monotonic).
  void update(const Replica& replica, std::uint64_t now_ns);

  // False until there is a first frame.
  bool is_valid() const { return is_valid_; }
  double tick() const { return tick_; }
  const std::vector<Vec3f>& positions() const { return positions_; }  // m, per vertex slot
  const std::vector<Tool>& tools() const { return tools_; }
  const std::vector<std::uint16_t>& regions() const { return regions_; }

 private:
  void interpolate(const Topology& topology, const SessionFrame& before, const SessionFrame& after,
                   float t);
  void restart(const Replica& replica, std::uint64_t now_ns);
  void glide(std::uint64_t now_ns);

  DisplayClock clock_;
  std::uint64_t history_version_ = 0;
  Tick last_tick_ = 0;
  bool has_tick_ = false, is_valid_ = false;
  double tick_ = 0;
  std::vector<Vec3f> positions_;
  std::vector<Tool> tools_;
  std::vector<std::uint16_t> regions_;
  std::uint64_t welcome_count_ = 0;
  std::uint64_t glide_begin_ns_ = 0;
  std::vector<Vec3f> glide_from_;  // m, per vertex slot; empty: no glide
};

}  // namespace trocar::replica
