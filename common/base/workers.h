#pragma once

// A fixed team of threads that runs one function at a time, all together, with barriers inside: for
// forking over colours within a tick. The caller is worker 0. Waits spin for some microseconds,
// because colours are short, then give the core away, because cores are shared.

#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>
#include <type_traits>
#include <vector>

namespace trocar {

inline constexpr unsigned kMaxWorkers = 64;

class Workers {
 public:
  explicit Workers(unsigned count);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  unsigned count() const { return count_; }
  // Calls task(worker) once on every worker and returns when all have returned.
  template <typename Task>
  void run(Task&& task) {
    using Body = std::remove_reference_t<Task>;
    run_all({[](void* body, unsigned worker) { (*static_cast<Body*>(body))(worker); },
             const_cast<void*>(static_cast<const void*>(std::addressof(task)))});
  }
  // Inside a task: returns when every worker has come here.
  void barrier();

 private:
  // A callable by reference: starting a task allocates nothing.
  struct Call {
    void (*function)(void*, unsigned) = nullptr;
    void* body = nullptr;
  };
  void run_all(Call call);
  void serve(unsigned worker);

  const unsigned count_;
  std::vector<std::thread> threads_;
  Call call_;
  std::atomic<std::uint32_t> epoch_{0};  // of the task; raised to start it
  std::atomic<std::uint32_t> arrived_{0}, phase_{0};
  std::atomic<bool> is_stopping_{false};
};

}  // namespace trocar
