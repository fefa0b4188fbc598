#pragma once

// The newest of many values, from exactly one thread that writes to exactly one that reads, without
// locks: neither ever waits for the other. What was not read in time is lost, and should be.
//
//   writer's slot --publish--> middle slot <--take-- reader's slot
//
// The three slots change hands by an atomic exchange of their numbers.

#include <array>
#include <atomic>

namespace trocar::device {

template <typename T>
class Newest {
 public:
  // Writer.
  void publish(const T& value) {
    slots_[writer_] = value;
    writer_ = middle_.exchange(writer_ | kIsNew, std::memory_order_acq_rel) & kSlot;
  }
  // Reader: the newest value; a default one if there was none.
  const T& take() {
    if (middle_.load(std::memory_order_relaxed) & kIsNew)
      reader_ = middle_.exchange(reader_, std::memory_order_acq_rel) & kSlot;
    return slots_[reader_];
  }

 private:
  static constexpr unsigned kSlot = 3, kIsNew = 4;

  std::array<T, 3> slots_{};
  unsigned writer_ = 0, reader_ = 1;
  std::atomic<unsigned> middle_{2};
};

}  // namespace trocar::device
