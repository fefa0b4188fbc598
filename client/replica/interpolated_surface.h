#pragma once

// The surface to show now: float positions and tools between two published frames are computed
// here.
//
// Frames arrive every 16 ms, or less often, with jitter. The display runs behind them by as much as
// this client needs so that 95 times in a hundred there is a frame on either side. Its tick follows
//   target = tick that a frame without jitter would have now - delay,   at most the newest tick,
//   delay  = 95th percentile, over the last 128 frames, of lateness + ticks since the frame before,
// where both are in ticks, and the rate of ticks is measured over the last half second of arrivals:
// simulated time may run slower than real time, a replay at any speed. It is slewed, never stepped
// back; after a seek or a gap of more than 250 ticks it jumps. Nothing is extrapolated: at the
// newest frame the picture holds still. After a return to the session (Replica::welcome_count) the
// tissue glides from where it was shown last to where it is, in 0.3 s. Thread: render thread.

#include <deque>

#include "client/replica/replica.h"

namespace trocar::replica {

// These hold for the display at real time.
inline constexpr double kFirstDelayTicks = 24, kLeastDelayTicks = 17, kMostDelayTicks = 120;

// Estimates the display tick from arrivals. Separate from the surface so that it can be tested
// alone.
class DisplayClock {
 public:
  void restart();
  // Takes each frame once, in order.
  void add_arrival(Tick tick, std::uint64_t arrival_ns);
  // Advances to `now_ns` and returns the display tick; monotone between restarts.
  double advance(std::uint64_t now_ns);
  // Ticks by which the display runs behind frames that come without jitter.
  double delay_ticks() const { return delay_ticks_; }

 private:
  struct Arrival {
    Tick tick;
    std::uint64_t ns;
  };
  double rate() const;  // ticks per second
  // Returns where the server is, as the least delayed of the last frames say.
  double tick_without_jitter(std::uint64_t now_ns) const;
  void adapt_delay(double ticks_since_last);

  std::deque<Arrival> arrivals_;
  std::deque<double> needed_ticks_;  // of the last frames
  double delay_ticks_ = kFirstDelayTicks;
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
  double delay_ticks() const { return clock_.delay_ticks(); }
  const std::vector<Vec3f>& positions() const { return positions_; }  // m, per vertex slot
  // Depth of blood in levels, per vertex slot; empty: the session does not bleed.
  const std::vector<float>& blood() const { return blood_; }
  const std::vector<Tool>& tools() const { return tools_; }
  const std::vector<std::uint16_t>& regions() const { return regions_; }
  const wire::ThreadPicture& threads() const { return threads_; }
  // m, per node of the threads.
  const std::vector<Vec3f>& thread_places() const { return thread_places_; }

 private:
  void interpolate(const Topology& topology, const SessionFrame& before, const SessionFrame& after,
                   float t);
  void interpolate_threads(const SessionFrame& before, const SessionFrame& known, float t);
  void restart(const Replica& replica, std::uint64_t now_ns);
  void glide(std::uint64_t now_ns);

  DisplayClock clock_;
  std::uint64_t history_version_ = 0;
  Tick last_tick_ = 0;
  bool has_tick_ = false, is_valid_ = false;
  double tick_ = 0;
  std::vector<Vec3f> positions_;
  std::vector<float> blood_;
  std::vector<Tool> tools_;
  std::vector<std::uint16_t> regions_;
  wire::ThreadPicture threads_;
  std::vector<Vec3f> thread_places_;
  std::uint64_t welcome_count_ = 0;
  std::uint64_t glide_begin_ns_ = 0;
  std::vector<Vec3f> glide_from_;  // m, per vertex slot; empty: no glide
};

}  // namespace trocar::replica
