#pragma once

// Published frames from the simulation thread to the I/O thread: a bounded queue and a wake-up.
// 512 frames are 8 s. If the I/O thread is stuck for longer, frames are dropped and counted, but
// for those that change the surface, or tell of a mark: without one of them no later frame can be
// understood. The journal has its own way (journal_sink.h).

#include <atomic>
#include <deque>
#include <functional>
#include <vector>

#include "common/base/spsc_queue.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::app {

class FrameHandover {
 public:
  static constexpr std::size_t kCapacity = 512;

  // `wake` is called on the simulation thread, at most once until the next pop_all().
  explicit FrameHandover(std::function<void()> wake) : wake_(std::move(wake)) {}

  // Simulation thread.
  void push(step::SharedFrame frame) {
    while (!kept_.empty() && queue_.try_push(kept_.front())) kept_.pop_front();
    if (!kept_.empty() || !queue_.try_push(frame)) {
      if (frame->change || frame->new_layout || !frame->mark_events.empty())
        kept_.push_back(std::move(frame));
      else
        dropped_.fetch_add(1, std::memory_order_relaxed);
    }
    if (!is_woken_.exchange(true)) wake_();
  }

  // I/O thread: everything there is, oldest first.
  void pop_all(std::vector<step::SharedFrame>& frames) {
    frames.clear();
    is_woken_.exchange(false);
    while (frames.size() <= kCapacity) {
      auto frame = queue_.try_pop();
      if (!frame) break;
      frames.push_back(std::move(*frame));
    }
  }

  std::uint64_t dropped() const { return dropped_.load(std::memory_order_relaxed); }

 private:
  std::function<void()> wake_;
  SpscQueue<step::SharedFrame> queue_{kCapacity};
  std::deque<step::SharedFrame> kept_;  // simulation thread: did not fit, come next
  std::atomic<bool> is_woken_{false};
  std::atomic<std::uint64_t> dropped_{0};
};

}  // namespace trocar::app
