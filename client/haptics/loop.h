#pragma once

// Runs a hand, or what else steps, at the device's rate on a thread of its own, by absolute time of
// the monotonic clock. A step that ends after the next one should have begun is an overrun; what
// was missed is left out.
//
// However the loop ends, the last thing that it writes to the device is no force. One that is
// stopped goes on until its hand has let go, for at most kLetGo_ms.

#include <atomic>
#include <cstdint>
#include <optional>
#include <thread>

#include "client/haptics/stepped.h"
#include "client/haptics/wake_statistics.h"
#include "common/base/newest.h"
#include "common/base/result.h"

namespace trocar::haptics {

struct LoopSettings {
  double rate_hz = 1000;
  bool wants_real_time = true;  // a real-time priority and locked memory, if the system grants them
};

struct LoopTiming {
  double rate_hz = 0;                                         // of the last quarter of a second
  double late_median_us = 0, late_95_us = 0, late_99_us = 0;  // of a wake, since the start
  double late_worst_us = 0;
  std::uint64_t steps = 0, overruns = 0;
};

class Loop {
 public:
  static constexpr int kLetGo_ms = 80;  // 20 N, more than any device renders, take 67

  // Says what the system granted.
  struct Granted {
    bool has_priority = false;       // SCHED_FIFO
    bool has_locked_memory = false;  // no page of the program is fetched from a disk meanwhile
  };

  Loop(Stepped& hand, const LoopSettings& settings);
  ~Loop() { stop(); }
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;

  Granted start();
  // Returns at once: the hand lets go, then the loop ends.
  void let_go() { must_stop_ = true; }
  // Does the same, and waits for the end.
  void stop();
  // False: it was stopped, or the device is gone.
  bool is_running() const { return is_running_.load(std::memory_order_acquire); }
  // Why it ended by itself; only once it does not run.
  const std::optional<Error>& failure() const { return failure_; }
  // One other thread. False: there is no newer one.
  bool take_timing(LoopTiming& timing) { return timings_.take(timing); }

 private:
  Granted ask_for_real_time();
  void run() noexcept;
  void publish(std::uint64_t now_ns);

  Stepped& hand_;
  LoopSettings settings_;
  std::atomic<bool> is_running_{false}, must_stop_{false};
  std::atomic<int> granted_{-1};  // bits, once known
  std::optional<Error> failure_;
  Newest<LoopTiming> timings_;
  LoopTiming timing_;
  WakeStatistics late_;
  std::uint64_t published_ns_ = 0, published_steps_ = 0;
  std::jthread thread_;
};

}  // namespace trocar::haptics
