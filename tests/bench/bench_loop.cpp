// This measures the loop that renders forces, on this machine: how late it wakes, idle and with all
// cores busy, with and without real-time priority, and while no answer comes for five seconds. And
// what the dead-band of readings costs and saves.
//
// The hand is calculated and palpates; a thread answers for the server, with an elastic surface.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <thread>
#include <vector>

#include "client/device/device_checks.h"
#include "client/device/simulated_device.h"
#include "client/haptics/hand.h"
#include "client/haptics/loop.h"
#include "client/haptics/reading_pace.h"
#include "common/base/timing.h"

namespace trocar {
namespace {

using std::chrono::duration;
using std::chrono::milliseconds;

constexpr double kStiffness_n_m = 110, kSurface_m = 0.002;
constexpr milliseconds kFrame{16};

device::SimulatedDevice palpating_hand() {
  return {*device::HandScript::parse("palpate,1Hz,3mm,6mm,-z"), device::monotonic_us};
}

haptics::HandSettings hand_settings() {
  haptics::HandSettings settings;
  settings.shape.radius_m = 0.006f;
  return settings;
}

// Answers what the hand reads, as a server does with each frame.
class Surface {
 public:
  explicit Surface(haptics::Hand& hand)
      : hand_(hand), thread_([this](const std::stop_token& stop) { answer(stop); }) {}

  void set_silent(bool is_silent) { is_silent_ = is_silent; }
  // Since the last call.
  double largest_force_n() { return largest_force_n_.exchange(0); }
  std::uint64_t steps() const { return steps_; }  // of the hand, 16 ms ago or less

 private:
  void answer(const std::stop_token& stop) {
    haptics::HandReading reading;
    haptics::HandState state;
    wire::HapticPatch patch;
    while (!stop.stop_requested()) {
      std::this_thread::sleep_for(kFrame);
      if (hand_.take_state(state)) {
        largest_force_n_ = std::max(largest_force_n_.load(), length(state.hand_force_n));
        steps_ = state.steps;
      }
      if (!hand_.take_reading(reading) || is_silent_) continue;
      const double depth_m = -kSurface_m - reading.tip_m.z;
      ++patch.sequence;
      patch.kind = depth_m > 0 ? wire::TouchKind::Push : wire::TouchKind::Near;
      patch.plane_point_m = {0, 0, static_cast<float>(-kSurface_m)};
      patch.force_n = {0, 0, static_cast<float>(std::max(0.0, depth_m) * kStiffness_n_m)};
      patch.echo_time_us = reading.time_us;
      patch.used_position_m = to_float(reading.tip_m);
      hand_.put(patch);
    }
  }

  haptics::Hand& hand_;
  std::atomic<bool> is_silent_{false};
  std::atomic<double> largest_force_n_{0};
  std::atomic<std::uint64_t> steps_{0};
  std::jthread thread_;
};

// Keeps each core busy.
class Load {
 public:
  explicit Load(bool is_on) {
    for (unsigned i = 0; is_on && i < std::thread::hardware_concurrency(); ++i)
      threads_.emplace_back([](const std::stop_token& stop) {
        volatile double sum = 0;
        while (!stop.stop_requested()) sum = sum + 1;
      });
  }

 private:
  std::vector<std::jthread> threads_;
};

void print(const char* what, bool has_priority, const haptics::LoopTiming& timing, double seconds) {
  std::printf("| %s | %s | %.1f | %.0f | %.0f | %.0f | %.0f | %llu |\n", what,
              has_priority ? "yes" : "no", static_cast<double>(timing.steps) / seconds,
              timing.late_median_us, timing.late_95_us, timing.late_99_us, timing.late_worst_us,
              static_cast<unsigned long long>(timing.overruns));
  std::fflush(stdout);
}

void measure(bool is_busy, bool wants_priority, double seconds) {
  auto device = palpating_hand();
  haptics::Hand hand(device, hand_settings());
  const Load load(is_busy);
  Surface surface(hand);
  haptics::Loop loop(hand, {.wants_real_time = wants_priority});
  const auto granted = loop.start();
  const auto begin_ns = monotonic_ns();
  std::this_thread::sleep_for(duration<double>(seconds));
  loop.stop();
  const double took = static_cast<double>(monotonic_ns() - begin_ns) * 1e-9;
  haptics::LoopTiming timing;
  loop.take_timing(timing);
  print(is_busy ? "busy" : "idle", granted.has_priority, timing, took);
}

// The network is gone for five seconds in contact.
void measure_cut() {
  auto device = palpating_hand();
  haptics::Hand hand(device, hand_settings());
  Surface surface(hand);
  haptics::Loop loop(hand, {});
  const auto granted = loop.start();
  const auto begin_ns = monotonic_ns();
  std::this_thread::sleep_for(std::chrono::seconds(3));
  const double before_n = surface.largest_force_n();
  surface.set_silent(true);
  std::this_thread::sleep_for(milliseconds(520));
  surface.largest_force_n();
  const auto steps = surface.steps();
  const auto cut_ns = monotonic_ns();
  std::this_thread::sleep_for(milliseconds(4480));
  const double cut_s = static_cast<double>(monotonic_ns() - cut_ns) * 1e-9;
  const auto cut_steps = surface.steps() - steps;
  const double cut_n = surface.largest_force_n();
  surface.set_silent(false);
  std::this_thread::sleep_for(std::chrono::seconds(3));
  const double after_n = surface.largest_force_n();
  loop.stop();
  haptics::LoopTiming timing;
  loop.take_timing(timing);
  print("idle, 5 of 11 s without answers", granted.has_priority, timing,
        static_cast<double>(monotonic_ns() - begin_ns) * 1e-9);
  std::printf(
      "\nWithout answers, from 0.52 s on: %.1f steps a second. Greatest force before, then, "
      "and after: %.3f, %.3f, %.3f N\n",
      static_cast<double>(cut_steps) / cut_s, before_n, cut_n, after_n);
}

// The server takes the newest reading that has come; the error is how far the tip is from it.
void measure_dead_band(const char* motion, double dead_band_m) {
  constexpr std::uint64_t kSteps = 20'000, kWarmUp = 1000;
  std::uint64_t now_us = 1'000'000;
  device::SimulatedDevice device(*device::HandScript::parse(motion), [&] { return now_us; });
  haptics::ReadingPace pace;
  pace.dead_band_m = dead_band_m;
  haptics::HandReading sent;
  std::uint64_t sent_us = 0, count = 0;
  double worst_m = 0, squares = 0;
  for (std::uint64_t i = 0; i < kSteps; ++i) {
    now_us += 1000;
    haptics::HandReading reading;
    reading.tip_m = device.read()->position_m;
    if (sent_us == 0 || haptics::is_due(reading, sent, (now_us - sent_us) * 1000, pace)) {
      sent = reading;
      sent_us = now_us;
      ++count;
    }
    if (i < kWarmUp) continue;
    const double error_m = length(reading.tip_m - sent.tip_m);
    worst_m = std::max(worst_m, error_m);
    squares += error_m * error_m;
  }
  std::printf("| %s | %.0f | %.0f | %.1f | %.0f |\n", motion, dead_band_m * 1e6,
              1e3 * static_cast<double>(count) / kSteps,
              1e6 * std::sqrt(squares / static_cast<double>(kSteps - kWarmUp)), 1e6 * worst_m);
}

}  // namespace
}  // namespace trocar

int main(int argc, char** argv) {
  using namespace trocar;
  double seconds = 60;
  CLI::App app("Measures the loop that renders forces, and what the dead-band of readings costs.",
               "bench_loop");
  app.add_option("--seconds", seconds, "for each row")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  std::puts(
      "| machine | real-time priority | steps a second | late, median (us) | 95th (us) | 99th (us) "
      "| worst (us) | overruns |\n|---|---|--:|--:|--:|--:|--:|--:|");
  for (const bool is_busy : {false, true})
    for (const bool wants_priority : {true, false}) measure(is_busy, wants_priority, seconds);
  measure_cut();
  std::puts(
      "\n| motion | dead-band (um) | readings a second | error, rms (um) | worst (um) "
      "|\n|---|--:|--:|--:|--:|");
  for (const char* motion : {"still", "palpate,0.2Hz,3mm", "palpate,1Hz,3mm", "tap,2Hz,10mm"})
    for (const double dead_band_m : {0.0, 60e-6}) measure_dead_band(motion, dead_band_m);
  return 0;
}
