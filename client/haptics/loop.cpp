#include "client/haptics/loop.h"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

#include <cerrno>
#include <ctime>

#include "common/base/timing.h"

namespace trocar::haptics {
namespace {

constexpr int kPriority = 60;  // of 99
constexpr std::uint64_t kPublish_ns = 250'000'000;

void sleep_until(std::uint64_t ns) {
  timespec until{};
  until.tv_sec = static_cast<time_t>(ns / 1'000'000'000u);
  until.tv_nsec = static_cast<long>(ns % 1'000'000'000u);
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) continue;
}

}  // namespace

Loop::Loop(Stepped& hand, const LoopSettings& settings) : hand_(hand), settings_(settings) {}

Loop::Granted Loop::start() {
  if (thread_.joinable()) stop();
  failure_.reset();
  timing_ = {};
  late_ = {};
  published_steps_ = 0;
  must_stop_ = false;
  granted_ = -1;
  is_running_ = true;
  thread_ = std::jthread([this] { run(); });
  granted_.wait(-1);
  const int granted = granted_;
  return {(granted & 1) != 0, (granted & 2) != 0};
}

void Loop::stop() {
  let_go();
  if (thread_.joinable()) thread_.join();
}

Loop::Granted Loop::ask_for_real_time() {
  if (!settings_.wants_real_time) return {};
  sched_param parameters{};
  parameters.sched_priority = kPriority;
  Granted granted;
  granted.has_priority = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters) == 0;
  // Only what is there already: the loop allocates nothing, and the rest of the program may not
  // come to a limit.
  granted.has_locked_memory = mlockall(MCL_CURRENT) == 0;
  return granted;
}

void Loop::run() noexcept {
  const Granted granted = ask_for_real_time();
  granted_ = (granted.has_priority ? 1 : 0) + (granted.has_locked_memory ? 2 : 0);
  granted_.notify_all();

  const auto period_ns = static_cast<std::uint64_t>(1e9 / settings_.rate_hz);
  std::uint64_t next_ns = monotonic_ns() + period_ns;
  published_ns_ = monotonic_ns();
  int last_steps = static_cast<int>(kLetGo_ms * settings_.rate_hz / 1000);
  while (!must_stop_.load(std::memory_order_relaxed) || (!hand_.let_go() && last_steps-- > 0)) {
    sleep_until(next_ns);
    const std::uint64_t woke_ns = monotonic_ns();
    late_.add(static_cast<double>(woke_ns - next_ns) * 1e-3);
    if (Status status = hand_.step(woke_ns / 1000); !status) {
      failure_ = status.error();
      break;
    }
    ++timing_.steps;
    const std::uint64_t done_ns = monotonic_ns();
    next_ns += period_ns;
    if (done_ns > next_ns) {
      ++timing_.overruns;
      next_ns += (done_ns - next_ns) / period_ns * period_ns + period_ns;
    }
    if (done_ns - published_ns_ >= kPublish_ns) publish(done_ns);
  }
  hand_.stop();
  publish(monotonic_ns());
  if (granted.has_locked_memory) munlockall();
  is_running_.store(false, std::memory_order_release);
}

void Loop::publish(std::uint64_t now_ns) {
  const auto steps = static_cast<double>(timing_.steps - published_steps_);
  if (now_ns > published_ns_)
    timing_.rate_hz = steps * 1e9 / static_cast<double>(now_ns - published_ns_);
  published_ns_ = now_ns;
  published_steps_ = timing_.steps;
  timing_.late_median_us = late_.quantile_us(0.5);
  timing_.late_95_us = late_.quantile_us(0.95);
  timing_.late_99_us = late_.quantile_us(0.99);
  timing_.late_worst_us = late_.worst_us();
  timings_.put(timing_);
}

}  // namespace trocar::haptics
