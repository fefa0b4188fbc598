#pragma once

// Hands the newest value from exactly one thread to exactly one other, without locks and without
// waiting. What the reader did not fetch before the next one came is lost. Three slots: one is the
// writer's, one the reader's, and the third lies between them.

#include <array>
#include <atomic>
#include <cstdint>
#include <type_traits>

namespace trocar {

template <typename Value>
class Newest {
  static_assert(std::is_trivially_copyable_v<Value>);

 public:
  // Writer's thread.
  void put(const Value& value) {
    slots_[writers_] = value;
    const auto old = between_.exchange(writers_ | kIsNew, std::memory_order_acq_rel);
    writers_ = old & kSlot;
  }

  // Reader's thread. The newest of all; a default one before the first.
  const Value& newest() {
    if ((between_.load(std::memory_order_relaxed) & kIsNew) != 0)
      readers_ = between_.exchange(readers_, std::memory_order_acq_rel) & kSlot;
    return slots_[readers_];
  }

  // Takes the newest likewise. False: nothing came since the last call, `value` is as it was.
  bool take(Value& value) {
    if ((between_.load(std::memory_order_relaxed) & kIsNew) == 0) return false;
    value = newest();
    return true;
  }

 private:
  static constexpr std::uint32_t kSlot = 3, kIsNew = 4;

  std::array<Value, 3> slots_{};
  alignas(64) std::atomic<std::uint32_t> between_{0};
  alignas(64) std::uint32_t writers_ = 1;
  alignas(64) std::uint32_t readers_ = 2;
};

}  // namespace trocar
