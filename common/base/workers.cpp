#include "common/base/workers.h"

#include <immintrin.h>

#include <algorithm>

namespace trocar {
namespace {

constexpr int kSpins = 4000;  // some 20 us: longer than a colour takes

// Returns when `value` is no longer `old`.
void wait_for_change(const std::atomic<std::uint32_t>& value, std::uint32_t old) {
  for (int i = 0; i < kSpins; ++i) {
    if (value.load(std::memory_order_acquire) != old) return;
    _mm_pause();
  }
  while (value.load(std::memory_order_acquire) == old) value.wait(old, std::memory_order_acquire);
}

}  // namespace

Workers::Workers(unsigned count) : count_(std::clamp(count, 1u, kMaxWorkers)) {
  for (unsigned w = 1; w < count_; ++w) threads_.emplace_back([this, w] { serve(w); });
}

Workers::~Workers() {
  is_stopping_ = true;
  epoch_.fetch_add(1, std::memory_order_release);
  epoch_.notify_all();
  for (auto& thread : threads_) thread.join();
}

void Workers::serve(unsigned worker) {
  std::uint32_t seen = 0;
  while (true) {
    wait_for_change(epoch_, seen);
    ++seen;
    if (is_stopping_) return;
    call_.function(call_.body, worker);
    barrier();
  }
}

void Workers::run_all(Call call) {
  if (count_ == 1) return call.function(call.body, 0);
  call_ = call;
  epoch_.fetch_add(1, std::memory_order_release);
  epoch_.notify_all();
  call.function(call.body, 0);
  barrier();
}

void Workers::barrier() {
  if (count_ == 1) return;
  const auto phase = phase_.load(std::memory_order_acquire);
  if (arrived_.fetch_add(1, std::memory_order_acq_rel) + 1 == count_) {
    arrived_.store(0, std::memory_order_relaxed);
    phase_.fetch_add(1, std::memory_order_release);
    phase_.notify_all();
    return;
  }
  wait_for_change(phase_, phase);
}

}  // namespace trocar
