#include "server/app/server/simulation_loop.h"

#include <sys/prctl.h>

#include <algorithm>
#include <ctime>

namespace trocar::app {
namespace {

// A snapshot every 10 s and when one is asked for, in the middle between two publications:
// publishing changes the hysteresis of the quantisation after the tick's hash was taken.
constexpr Tick kSnapshotPeriod = 10'000;
constexpr Tick kSnapshotPhase = kTicksPerFrame / 2;
constexpr unsigned long kTimerSlackNs = 1000;
constexpr std::size_t kMostQueuedBytes = 256 * 1024;  // of a recording, faster than real time
constexpr std::uint64_t kPauseNapNs = 5'000'000;
// One frame is on its way to the hands while the next is computed.
constexpr Frame kFramesAhead = 2;
// A tick that takes so much of its time leaves too little for what else there is to do.
constexpr double kShortLoad = 0.8;

void sleep_until(std::uint64_t monotonic) {
  const timespec until{static_cast<time_t>(monotonic / 1'000'000'000),
                       static_cast<long>(monotonic % 1'000'000'000)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

}  // namespace

void StageTimes::add(const step::TickReport& report) {
  std::uint64_t total = 0;
  for (std::size_t i = 0; i < stages.size(); ++i) {
    total += report.stage_cpu_ns[i];
    const bool has_run =
        i != static_cast<std::size_t>(step::Stage::Publish) || publishes_frame(report.tick);
    if (has_run) stages[i].add(report.stage_cpu_ns[i]);
  }
  tick.add(total);
}

void StageTimes::clear() {
  for (auto& stage : stages) stage.clear();
  tick.clear();
}

wire::PaceFigures StageTimes::figures() const {
  wire::PaceFigures result;
  for (std::size_t i = 0; i < stages.size(); ++i)
    result.stage_median_us[i] = static_cast<float>(stages[i].quantile_us(0.5));
  result.tick_median_us = static_cast<float>(tick.quantile_us(0.5));
  result.tick_p99_us = static_cast<float>(tick.quantile_us(0.99));
  return result;
}

void RateReport::add(const step::TickDecisions& decisions, bool has_contact,
                     wire::RateLevel level) {
  ++ticks_at[static_cast<std::size_t>(level)];
  const auto sweeps_now = step::sweeps_of_layers(decisions);
  if (least_node_limit == 0) {
    least_sweeps = sweeps_now;
    least_node_limit = decisions.node_limit;
  }
  least_node_limit = std::min(least_node_limit, decisions.node_limit);
  for (std::size_t layer = 0; layer < step::kSweepLayers; ++layer) {
    least_sweeps[layer] = std::min(least_sweeps[layer], sweeps_now[layer]);
    if (has_contact) sweeps[layer] += sweeps_now[layer];
  }
  contact_ticks += has_contact;
  for (std::size_t i = 0; i < kMaxTools; ++i) waits[i] += decisions.waiting_tools >> i & 1;
}

SimulationLoop::SimulationLoop(step::Simulation& simulation, participants::SimulationInbox& inbox,
                               FrameHandover& handover, JournalSink* journal, LoopOptions options,
                               std::function<void()> ended)
    : simulation_(simulation),
      inbox_(inbox),
      handover_(handover),
      journal_(journal),
      options_(options),
      ended_(std::move(ended)),
      chooser_(options_.rate ? simulation.organ().depth_table : organ::DepthTable{},
               options_.rate ? options_.rate->nodes : 0) {
  records_.reserve(kTicksPerFrame);
  if (options_.rate) controller_.emplace(*options_.rate);
  if (options_.most_workers > 0) team_size_.emplace(options_.most_workers);
  record_snapshot();
}

SimulationLoop::~SimulationLoop() {
  stop();
}

void SimulationLoop::stop() {
  request_stop();
  if (thread_.joinable()) thread_.join();
}

void SimulationLoop::start() {
  thread_ = std::thread([this] { run(); });
}

void SimulationLoop::run() {
  // The default slack of 50 us would be 5 % of a tick.
  prctl(PR_SET_TIMERSLACK, kTimerSlackNs, 0, 0, 0);
  Pacer pacer(monotonic_ns());
  bool is_last = false;
  float paced = 1;
  while (!is_last) {
    const float rate = this->rate();
    const bool is_shown = report_.last_frame && publishes_frame(simulation_.current_tick());
    if (rate == 0 && is_shown) {
      inbox_.gather();
      sleep_until(monotonic_ns() + kPauseNapNs);
      paced = 0;
      continue;
    }
    if (rate != paced && rate > 0) pacer.restart(monotonic_ns(), paced = rate);
    sleep_until(pacer.due_ns());
    const auto now = monotonic_ns();
    lateness_ns_ = now - pacer.due_ns();
    pacer.begin_tick(now);
    slow_ticks_ = pacer.slow_ticks();
    is_last = run_tick();
  }
  ended_();
}

float SimulationLoop::rate() const {
  if (is_stop_requested_.load(std::memory_order_relaxed)) return 1;
  const Frame followed = followed_.load(std::memory_order_relaxed);
  const bool is_followed =
      followed > 0 && simulation_.current_tick() <= kTicksPerFrame * (followed + kFramesAhead);
  // A recorder that does not follow would leave frames out.
  const bool is_recorded = journal_ == nullptr || journal_->queued_bytes() <= kMostQueuedBytes;
  return rate_.load(std::memory_order_relaxed) * (is_followed && is_recorded ? options_.pace : 1);
}

bool SimulationLoop::run_tick() {
  inbox_.drain(inputs_);
  if (chooser_.is_in_use()) control::read_forces(simulation_, forces_n_);
  auto decisions =
      chooser_.choose(controller_ ? controller_->decisions() : options_.decisions, forces_n_);
  decisions.waiting_tools = tool_waits_.waiting();
  if (team_size_) simulation_.use_workers(team_size_->count());
  const auto begin = options_.clock_ns();
  const auto& report = simulation_.tick(inputs_, decisions);
  const auto work_ns = options_.clock_ns() - begin;
  const double load = static_cast<double>(work_ns) / static_cast<double>(kTickNanoseconds);
  if (controller_) {
    controller_->observe(report, {work_ns, lateness_ns_});
    tool_waits_.observe(tissue_speeds_.read(simulation_), load);
  }
  const auto level = controller_ ? controller_->figures().level : wire::RateLevel::Fixed;
  if (report.contact.nodes > 0)
    report_.rate.contact_workers += team_size_ ? team_size_->count() : simulation_.workers();
  if (team_size_) {
    const bool gives_up = level == wire::RateLevel::Reduced || level == wire::RateLevel::Overloaded;
    team_size_->observe(load, gives_up || load > kShortLoad);
  }
  report_.rate.add(decisions, report.contact.nodes > 0, level);
  report_.rate.late_ticks += lateness_ns_ > kTickNanoseconds;
  records_.push_back({report.tick, decisions, inputs_, report.state_hash});
  second_.add(report);
  report_.times.add(report);
  ++report_.ticks;
  report_.inputs_dropped += report.inputs_dropped;
  report_.nodes_rejected += report.solve.nodes_rejected;
  report_.faults |= report.faults;
  report_.max_active_nodes = std::max(report_.max_active_nodes, report.near.active_nodes);
  if (report.tick % kTicksPerSecond == 0) {
    pace_ = second_.figures();
    second_.clear();
    const auto ticks = static_cast<float>(kTicksPerSecond);
    time_rate_ = ticks / (ticks + static_cast<float>(slow_ticks_ - slow_ticks_before_));
    slow_ticks_before_ = slow_ticks_;
    if (team_size_) team_size_->set_idle(idle_processors_.read());
  }
  if (report.tick % kSnapshotPeriod == kSnapshotPhase && report.tick > kSnapshotPeriod)
    record_snapshot();
  auto frame = simulation_.pop_frame();
  if (!frame) return false;
  finish_frame(std::move(frame));
  return is_stop_requested_.load(std::memory_order_relaxed) ||
         (options_.tick_count > 0 && report.tick >= options_.tick_count);
}

void SimulationLoop::finish_frame(std::shared_ptr<step::PublishedFrame> frame) {
  frame->records = std::exchange(records_, {});
  records_.reserve(kTicksPerFrame);
  frame->snapshot = std::exchange(snapshot_, nullptr);
  frame->snapshot_tick = snapshot_tick_;
  auto& pace = frame->figures.pace = pace_;
  pace.slow_ticks = slow_ticks_;
  if (controller_) pace.rate = controller_->figures();
  pace.rate.time_rate = time_rate_;
  pace.rate.waiting_tools = tool_waits_.waited_lately();
  report_.slow_ticks = slow_ticks_;
  report_.last_frame = frame;
  if (journal_) journal_->record_frame(report_.last_frame);
  handover_.push(report_.last_frame);
}

void SimulationLoop::record_snapshot() {
  Bytes bytes;
  simulation_.write_snapshot(bytes);
  snapshot_ = std::make_shared<const Bytes>(std::move(bytes));
  snapshot_tick_ = simulation_.current_tick();
}

}  // namespace trocar::app
