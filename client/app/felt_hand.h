#pragma once

// A hand that feels: a device, the loop that renders its force at 1 kHz, the answers that come from
// the server, and the readings that leave for it.
//
// Threads: the loop has its own. The network's thread brings answers and takes readings, also while
// start() runs; the render thread does the rest. None of them waits for another.

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/app/hand_reporter.h"
#include "client/device/haptic_device.h"
#include "client/haptics/hand.h"
#include "client/haptics/loop.h"
#include "common/base/newest.h"
#include "common/base/result.h"
#include "common/base/spsc_queue.h"
#include "common/tool/instrument.h"
#include "common/wire/haptic_patch.h"

namespace trocar::app {

// People see these, and the summary has them.
struct FeltFigures {
  std::string device;
  haptics::WorkspaceScale scale;
  haptics::LoopTiming timing;
  haptics::HandState state;  // the newest
  std::uint64_t readings_sent = 0;
  double sent_median_ms = 0, sent_99_ms = 0;  // from one reading that left to the next
  bool has_priority = false, has_locked_memory = false;
};

// This says what a hand holds, and how.
struct FeltSettings {
  tool::Instrument tool = tool::instruments().front();
  std::optional<Vec3d> port_m;  // that its shaft passes, world frame; none: it is free
  haptics::WorkspaceScale scale;
  bool has_trace = false;  // each step is kept, for at most ten minutes
};
inline constexpr std::size_t kMostTraceRows = 600'000;

class FeltHand {
 public:
  // A device that brings its own tool is held as that says.
  FeltHand(std::unique_ptr<device::HapticDevice> device, const FeltSettings& settings);

  // Render thread.
  const tool::ToolShape& shape() const { return settings_.tool.shape; }
  bool is_started() const { return loop_ != nullptr; }
  // start_m: where the tool's tip is at first, world frame, if the device does not say. An error:
  // its shaft does not reach there through the port.
  Status start(const Vec3d& start_m);
  // Does as Hand::put_view; before the start, too. A device with a tool of its own moves in the
  // world, however it is seen.
  void set_view(const Quatf& world_from_device);
  // Is called often. An error: the device is gone. It warns of readings that come too late.
  Status check();
  // Most readings of the second before were too old, so the hand felt nothing.
  bool has_old_readings() const { return has_old_readings_; }
  const FeltFigures& figures();
  // Says where a reading had the tip, and when it left; what nobody asks for in time is left out.
  struct Sent {
    Vec3f tip_m;
    std::uint64_t ns = 0;
  };
  std::optional<Sent> pop_sent() { return sent_places_.try_pop(); }
  // Begins to end the loop.
  void let_go() {
    if (loop_) loop_->let_go();
  }
  // Ends the loop; no force is left. Then the trace may be read; null: there is none.
  const haptics::Trace* stop();

  // Network's thread. Laws of before the start are kept, patches are dropped.
  void take(const wire::HapticLaw& law);
  void take(const wire::HapticPatch& patch);
  // The reading that is due at the server: a hand that rests says so every 20 ms.
  std::optional<haptics::HandReading> pop_reading(std::uint64_t now_ns);
  // Tells what the hand has felt, if there is enough for a report; without the tool's number.
  std::optional<wire::HandReport> pop_report();

 private:
  static constexpr std::size_t kSentPlaces = 1024;  // of 4 s

  struct SendTimes {
    std::uint64_t count = 0;
    double median_us = 0, most_us = 0;  // 99 % are shorter
  };

  void judge_readings();
  bool is_due(const haptics::HandReading& reading, std::uint64_t now_ns) const;
  void pass_on_laws();
  void note_sent(std::uint64_t now_ns);

  std::unique_ptr<device::HapticDevice> device_;
  FeltSettings settings_;
  Quatf view_;
  std::unique_ptr<haptics::Trace> trace_;
  std::unique_ptr<haptics::Hand> hand_;
  std::unique_ptr<haptics::Loop> loop_;
  std::atomic<bool> is_live_{false};  // the hand may be used on the network's thread
  FeltFigures figures_;
  bool has_old_readings_ = false;
  std::uint64_t judged_steps_ = 0, judged_old_ = 0;  // steps so far, and those with old readings
  SpscQueue<Sent> sent_places_{kSentPlaces};
  Newest<SendTimes> send_times_;

  // Network's thread.
  std::vector<wire::HapticLaw> waiting_laws_;
  haptics::HandReading reading_, sent_;
  std::uint64_t sent_ns_ = 0;
  SendTimes times_;
  haptics::WakeStatistics intervals_;
  HandReporter reporter_;
};

}  // namespace trocar::app
