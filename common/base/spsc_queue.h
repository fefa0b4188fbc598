#pragma once

// Bounded queue from exactly one producer thread to exactly one consumer thread, without locks.
// When full, try_push returns false and the producer decides; nothing grows.

#include <atomic>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

namespace trocar {

template <typename T>
class SpscQueue {
 public:
  explicit SpscQueue(std::size_t capacity) : slots_(capacity + 1) {}

  // Producer thread.
  bool try_push(T value) {
    const auto tail = tail_.load(std::memory_order_relaxed);
    const auto next = (tail + 1) % slots_.size();
    if (next == head_.load(std::memory_order_acquire)) return false;
    slots_[tail] = std::move(value);
    tail_.store(next, std::memory_order_release);
    return true;
  }

  // Consumer thread.
  std::optional<T> try_pop() {
    const auto head = head_.load(std::memory_order_relaxed);
    if (head == tail_.load(std::memory_order_acquire)) return std::nullopt;
    std::optional<T> value(std::move(slots_[head]));
    slots_[head] = T{};
    head_.store((head + 1) % slots_.size(), std::memory_order_release);
    return value;
  }

 private:
  std::vector<T> slots_;
  alignas(64) std::atomic<std::size_t> head_{0};
  alignas(64) std::atomic<std::size_t> tail_{0};
};

}  // namespace trocar
