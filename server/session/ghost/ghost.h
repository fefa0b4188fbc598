#pragma once

// A GhostFollower on a thread of its own, of low priority, while somebody wants to see it.
//
//   I/O thread --push--> queue of 2 s --> ghost's thread: repeat, every 4th frame publish
//
// Whoever gives frames never waits for more than the queue's lock. If it does not keep up, the
// queue is emptied and it begins again from a new snapshot of the session. While nobody wants it,
// it has no state and takes no time.

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <thread>

#include "server/session/ghost/ghost_follower.h"

namespace trocar::ghost {

// Frames from one report to the next: 64 ms.
inline constexpr Frame kFramesPerReport = 4;
inline constexpr std::size_t kMostFrames = 128;  // in the queue

struct GhostOptions {
  step::TickDecisions decisions;  // but for the reduction, which is off
  // Asks for a snapshot in a frame soon; at most once a second, on the ghost's thread.
  std::function<void()> request_snapshot;
  // On the ghost's thread; must not wait.
  std::function<void(std::shared_ptr<const GhostReport>)> publish;
};

struct GhostCounters {
  std::uint64_t frames = 0;  // compared
  std::uint64_t begun = 0;   // times
  std::uint64_t fallen = 0;  // times that it did not keep up
  float largest_m = 0;       // to the session's surface
};

class Ghost {
 public:
  // `session` outlives it.
  Ghost(const step::Simulation& session, GhostOptions options);
  ~Ghost();

  // All are called from one thread.
  void set_wanted(bool is_wanted);
  void push(std::span<const step::SharedFrame> frames);
  // Any thread.
  GhostCounters counters() const;

 private:
  void run();
  // Waits for it; null: the end.
  step::SharedFrame next_frame();
  void report(const step::PublishedFrame& frame);
  void request_snapshot();

  const step::Simulation& session_;
  const GhostOptions options_;

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<step::SharedFrame> queue_;
  bool is_wanted_ = false, is_ending_ = false, has_lost_ = false;
  Tick newest_tick_ = 0;
  GhostCounters counters_;

  // Ghost's thread.
  std::optional<GhostFollower> follower_;
  GhostStatus reported_ = GhostStatus::Begins;
  std::uint64_t requested_ns_ = 0, warned_ns_ = 0;
  std::thread thread_;  // from when it was first wanted
};

}  // namespace trocar::ghost
