#pragma once

// One piece of work on a thread of its own, beside what its owner does meanwhile. One caller.

#include <atomic>
#include <thread>
#include <utility>

namespace trocar {

class Background {
 public:
  // Waits for the piece before.
  template <typename Work>
  void start(Work&& work) {
    wait();
    is_done_.store(false, std::memory_order_relaxed);
    thread_ = std::jthread([this, work = std::forward<Work>(work)]() mutable {
      work();
      is_done_.store(true, std::memory_order_release);
    });
  }
  // False: start() and wait() take no time.
  bool is_busy() const { return !is_done_.load(std::memory_order_acquire); }
  // Until it is done; at once if there is none.
  void wait() {
    if (thread_.joinable()) thread_.join();
  }

 private:
  std::atomic<bool> is_done_{true};
  std::jthread thread_;  // joins when it is destroyed
};

}  // namespace trocar
