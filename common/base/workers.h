#pragma once

// Threads that share the items of a loop: for forking over the nodes of a colour within a tick. The
// caller is worker 0. Nobody waits for a helper that does not run: each begins with items of its
// own, and takes those of others when it has done these, so that where another program has a
// helper's core the caller does all. Helpers spin for some microseconds, because loops are short
// and follow one another, then sleep, because cores are shared. Between two loops the team may
// become smaller and grow again.

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <thread>
#include <type_traits>
#include <vector>

namespace trocar {

inline constexpr unsigned kMaxWorkers = 64;

// Returns how many may help in a tick: one for each processor, but more than eight gain little.
unsigned usable_workers();

class Workers {
 public:
  explicit Workers(unsigned most);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  // Who there are, and who work; at first all do.
  unsigned most() const { return most_; }
  unsigned count() const { return count_.load(std::memory_order_relaxed); }
  // From the next loop on, 1 to most() work. Costs nothing.
  void use(unsigned count);

  // Calls task(i, worker) once for each i below n, and returns when all have returned. A worker,
  // below most(), does one item at a time, `grain` in a row: some microseconds of work.
  // n / grain < 2^32.
  template <typename Task>
  void for_each(std::size_t n, std::size_t grain, Task&& task) {
    using Body = std::remove_reference_t<Task>;
    share_out({[](void* body, std::size_t begin, std::size_t end, unsigned worker) {
                 for (auto i = begin; i < end; ++i) (*static_cast<Body*>(body))(i, worker);
               },
               const_cast<void*>(static_cast<const void*>(std::addressof(task))), n, grain});
  }

 private:
  using Function = void (*)(void* body, std::size_t begin, std::size_t end, unsigned worker);
  // A loop by reference: starting one allocates nothing.
  struct Loop {
    Function function = nullptr;
    void* body = nullptr;
    std::size_t n = 0, grain = 1;
  };
  // A share is what a worker begins with: the chunks up to `end`, of which the low half of the
  // ticket tells how many are left. The high half numbers loops.
  struct alignas(64) Share {
    std::atomic<std::uint64_t> ticket{0};
    std::atomic<std::size_t> end{0};
    std::atomic<std::uint32_t> bell{0};  // wakes the worker
    std::atomic<bool> sleeps{false};
  };

  void share_out(const Loop& loop);
  bool do_chunk(unsigned worker);
  bool do_chunk_of(Share& share, unsigned worker);
  bool is_any_left() const;
  void wake(unsigned worker);
  void serve(unsigned worker);
  void sleep(unsigned worker);

  const unsigned most_;
  std::atomic<unsigned> count_;
  std::vector<Share> shares_;  // per worker
  std::vector<std::thread> threads_;
  // A helper may read the loop while the next one is written; then it gets no chunk of it.
  std::atomic<Function> function_{nullptr};
  std::atomic<void*> body_{nullptr};
  std::atomic<std::size_t> n_{0}, grain_{1};
  std::uint64_t number_ = 0;
  std::atomic<std::size_t> done_{0};  // chunks
  std::atomic<bool> is_stopping_{false};
};

}  // namespace trocar
