#pragma once

// One piece of work on a thread of its own, beside what its owner does meanwhile. One caller.

#include <thread>
#include <utility>

namespace trocar {

class Background {
 public:
  // Waits for the piece before.
  template <typename Work>
  void start(Work&& work) {
    wait();
    thread_ = std::jthread(std::forward<Work>(work));
  }
  // Until it is done; at once if there is none.
  void wait() {
    if (thread_.joinable()) thread_.join();
  }

 private:
  std::jthread thread_;  // joins when it is destroyed
};

}  // namespace trocar
