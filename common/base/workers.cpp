#include "common/base/workers.h"

#include <immintrin.h>

#include <algorithm>

#include "common/base/assert.h"

namespace trocar {
namespace {

constexpr int kHelperSpins = 2000;  // some 30 us: longer than what lies between two loops of a tick
constexpr int kCallerSpins = 500;   // longer than a chunk takes
constexpr std::size_t kWorthWaking = 8;  // chunks
constexpr std::uint64_t kLeft = 0xffffffff;
constexpr unsigned kMostUsable = 8;

}  // namespace

unsigned usable_workers() {
  return std::clamp(std::thread::hardware_concurrency(), 1u, kMostUsable);
}

Workers::Workers(unsigned most)
    : most_(std::clamp(most, 1u, kMaxWorkers)), count_(most_), shares_(most_) {
  for (unsigned w = 1; w < most_; ++w) threads_.emplace_back([this, w] { serve(w); });
}

Workers::~Workers() {
  is_stopping_ = true;
  for (unsigned w = 1; w < most_; ++w) wake(w);
  for (auto& thread : threads_) thread.join();
}

void Workers::use(unsigned count) {
  TROCAR_ASSERT(count >= 1 && count <= most_);
  count_.store(count, std::memory_order_relaxed);
}

void Workers::share_out(const Loop& loop) {
  const std::size_t chunks = (loop.n + loop.grain - 1) / loop.grain, count = this->count();
  if (count == 1 || chunks <= 1) return loop.function(loop.body, 0, loop.n, 0);
  function_.store(loop.function, std::memory_order_relaxed);
  body_.store(loop.body, std::memory_order_relaxed);
  n_.store(loop.n, std::memory_order_relaxed);
  grain_.store(loop.grain, std::memory_order_relaxed);
  done_.store(0, std::memory_order_relaxed);
  for (std::size_t w = 0; w < count; ++w)
    shares_[w].end.store(chunks * (w + 1) / count, std::memory_order_relaxed);
  ++number_;
  for (std::size_t w = 0; w < count; ++w) {
    const auto left = chunks * (w + 1) / count - chunks * w / count;
    shares_[w].ticket.store(number_ << 32 | left, std::memory_order_release);
  }
  // Either this sees that a helper sleeps, or the helper sees the chunks before it does.
  std::atomic_thread_fence(std::memory_order_seq_cst);
  if (chunks >= kWorthWaking)
    for (unsigned w = 1; w < count; ++w)
      if (shares_[w].sleeps.load(std::memory_order_relaxed)) wake(w);
  while (do_chunk(0)) {
  }
  for (int spins = 0; done_.load(std::memory_order_acquire) != chunks; ++spins)
    if (spins < kCallerSpins)
      _mm_pause();
    else
      std::this_thread::yield();  // to a helper that has a chunk and no core
}

// Its own chunks first.
bool Workers::do_chunk(unsigned worker) {
  const unsigned count = this->count();
  for (unsigned i = 0; i < count; ++i)
    if (do_chunk_of(shares_[(worker + i) % count], worker)) return true;
  return false;
}

bool Workers::do_chunk_of(Share& share, unsigned worker) {
  auto ticket = share.ticket.load(std::memory_order_acquire);
  while ((ticket & kLeft) != 0) {
    // If the ticket is then still the same, the loop is not done and this is what it is.
    const Loop loop{function_.load(std::memory_order_relaxed),
                    body_.load(std::memory_order_relaxed), n_.load(std::memory_order_relaxed),
                    grain_.load(std::memory_order_relaxed)};
    const std::size_t chunk = share.end.load(std::memory_order_relaxed) - (ticket & kLeft);
    if (!share.ticket.compare_exchange_weak(ticket, ticket - 1, std::memory_order_acq_rel,
                                            std::memory_order_acquire))
      continue;
    const auto begin = chunk * loop.grain;
    loop.function(loop.body, begin, std::min(begin + loop.grain, loop.n), worker);
    done_.fetch_add(1, std::memory_order_release);
    return true;
  }
  return false;
}

bool Workers::is_any_left() const {
  return std::ranges::any_of(shares_, [](const Share& share) {
    return (share.ticket.load(std::memory_order_acquire) & kLeft) != 0;
  });
}

void Workers::wake(unsigned worker) {
  auto& bell = shares_[worker].bell;
  bell.fetch_add(1, std::memory_order_release);
  bell.notify_one();
}

void Workers::serve(unsigned worker) {
  int spins = 0;
  while (!is_stopping_.load(std::memory_order_acquire)) {
    if (worker < count() && do_chunk(worker)) {
      spins = 0;
    } else if (++spins < kHelperSpins) {
      _mm_pause();
    } else {
      sleep(worker);
      spins = 0;
    }
  }
}

void Workers::sleep(unsigned worker) {
  auto& own = shares_[worker];
  const auto rung = own.bell.load(std::memory_order_acquire);
  own.sleeps.store(true, std::memory_order_relaxed);
  std::atomic_thread_fence(std::memory_order_seq_cst);
  const bool has_work = worker < count() && is_any_left();
  if (!has_work && !is_stopping_.load(std::memory_order_acquire))
    own.bell.wait(rung, std::memory_order_acquire);
  own.sleeps.store(false, std::memory_order_relaxed);
}

}  // namespace trocar
