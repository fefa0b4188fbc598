#pragma once

// The simulation thread: 1 kHz by absolute time, inputs in, frames out. Scripted hands may have
// time go faster: as long as all hands have shown the newest frames, ticks come up to `pace` times
// as fast. A hand that does not follow, or one that is away, has real time.
//
//   inbox.drain -> Simulation::tick -> record -> RateController::observe, which decides the next
//   tick; every 16th tick: complete the frame (blood, records, hash, statistics, snapshot),
//   journal.record_frame, handover.push
//
// It never waits for the I/O thread or the journal. It ends after a published frame, so the last
// frame shows the last tick.

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "common/base/timing.h"
#include "server/app/server/frame_handover.h"
#include "server/app/server/idle_processors.h"
#include "server/app/server/journal_sink.h"
#include "server/app/server/pacer.h"
#include "server/session/control/depth_chooser.h"
#include "server/session/control/rate_controller.h"
#include "server/session/control/team_size.h"
#include "server/session/control/tool_waits.h"
#include "server/session/participants/inbox.h"
#include "server/session/replication/duration_histogram.h"
#include "server/tissue/step/simulation.h"

namespace trocar::app {

// Thread CPU time of the stages.
struct StageTimes {
  std::array<replication::DurationHistogram, step::kStageCount> stages;
  replication::DurationHistogram tick;

  void add(const step::TickReport& report);
  void clear();
  wire::PaceFigures figures() const;  // The loop adds slow ticks and rate.
};

// The report says what the rate controller decided, over the whole run.
struct RateReport {
  std::array<Tick, wire::kRateLevels> ticks_at{};          // by wire::RateLevel
  std::array<std::uint64_t, step::kSweepLayers> sweeps{};  // sums over ticks in contact, by layer
  Tick contact_ticks = 0;
  step::LayerCounts least_sweeps{};
  std::uint32_t least_node_limit = 0;
  std::uint64_t late_ticks = 0;         // began more than a tick after they were due
  std::array<Tick, kMaxTools> waits{};  // ticks in which a tool was held back
  std::uint64_t contact_workers = 0;    // sum over ticks in contact

  void add(const step::TickDecisions& decisions, bool has_contact, wire::RateLevel level);
};

struct LoopReport {
  Tick ticks = 0;  // that it has run
  std::uint64_t slow_ticks = 0;
  std::uint64_t inputs_dropped = 0, nodes_rejected = 0;
  std::uint32_t faults = 0;  // TickFault bits of all ticks
  std::uint32_t max_active_nodes = 0;
  RateReport rate;
  step::SharedFrame last_frame;
  StageTimes times;  // of the whole run
};

struct LoopOptions {
  step::TickDecisions decisions;  // without a rate controller
  float pace = 1;                 // of real time at most, while hands follow
  std::optional<control::RateLimits> rate;
  unsigned most_workers = 0;  // so many share a tick's work at most; 0: all that there are, always
  Tick tick_count = 0;        // end at the first frame at or after this; 0: when told to
  std::function<std::uint64_t()> clock_ns = monotonic_ns;  // of what ticks take; tests have others
};

class SimulationLoop {
 public:
  // All references outlive the loop; `journal` may be null. `ended` is called on the simulation
  // thread after its last access to any of them.
  SimulationLoop(step::Simulation& simulation, participants::SimulationInbox& inbox,
                 FrameHandover& handover, JournalSink* journal, LoopOptions options,
                 std::function<void()> ended);
  ~SimulationLoop();

  void start();
  void request_stop() { is_stop_requested_.store(true, std::memory_order_relaxed); }  // any thread
  // Simulated time over real time, for ticks to come; 0: none comes after the next frame, until the
  // rate is another or the loop is to end. Any thread.
  void set_rate(float rate) { rate_.store(rate, std::memory_order_relaxed); }
  // All hands have shown this frame. Any thread.
  void note_followed(Frame frame) { followed_.store(frame, std::memory_order_relaxed); }
  // Ends the loop at its next frame and waits for that.
  void stop();
  // After `ended` was called, or stop(), or start() never was.
  const LoopReport& report() const { return report_; }

  // Returns simulated over real time, for the next tick. For start()'s thread, and for tests.
  float rate() const;
  // One tick without pacing; true if it was the last. For start()'s thread, and for tests.
  bool run_tick();

 private:
  void run();
  void finish_frame(std::shared_ptr<step::PublishedFrame> frame);
  void record_snapshot();

  step::Simulation& simulation_;
  participants::SimulationInbox& inbox_;
  FrameHandover& handover_;
  JournalSink* const journal_;
  const LoopOptions options_;
  const std::function<void()> ended_;
  std::atomic<bool> is_stop_requested_{false};
  std::atomic<float> rate_{1};
  std::atomic<Frame> followed_{0};

  // Simulation thread.
  std::optional<control::RateController> controller_;
  control::DepthChooser chooser_;  // of a calibrated organ, unless decisions are fixed
  control::TissueSpeeds tissue_speeds_;
  control::ToolWaits tool_waits_;  // unless decisions are fixed
  std::optional<control::TeamSize> team_size_;
  IdleProcessors idle_processors_;
  std::vector<double> forces_n_;         // of the tools that touched in the last tick
  std::uint64_t lateness_ns_ = 0;        // of the tick about to run
  std::uint64_t slow_ticks_before_ = 0;  // until the last full second
  float time_rate_ = 1;                  // in it
  hands::TickInputs inputs_;
  std::vector<step::TickRecord> records_;  // since the last frame
  std::shared_ptr<const Bytes> snapshot_;  // waits for the next frame
  Tick snapshot_tick_ = 0;
  StageTimes second_;       // since the last statistics
  wire::PaceFigures pace_;  // of the last full second
  std::uint64_t slow_ticks_ = 0;
  LoopReport report_;
  std::thread thread_;
};

}  // namespace trocar::app
