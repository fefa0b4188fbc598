#include "server/app/sim/sim_journal.h"

#include <chrono>
#include <thread>
#include <utility>

namespace trocar::app {
namespace {

// A server takes its snapshots at the same ticks, see simulation_loop.cpp.
constexpr Tick kSnapshotPeriod = 10'000, kSnapshotPhase = kTicksPerFrame / 2;

}  // namespace

Result<std::unique_ptr<SimJournal>> SimJournal::create(
    const std::string& path, const step::Simulation& simulation,
    std::vector<participants::Participant> hands, bool has_external_loads,
    const std::optional<journal::ReductionDescription>& reduction) {
  auto recorder = recording::Recorder::create(path, simulation.organ(), simulation.layout(),
                                              reduction, has_external_loads);
  if (!recorder) return recorder.error();
  std::unique_ptr<SimJournal> journal(new SimJournal(std::move(*recorder)));
  journal->recorder_->record_participants(std::move(hands), 0);
  journal->record_snapshot(simulation);
  return journal;
}

void SimJournal::record_snapshot(const step::Simulation& simulation) {
  Bytes bytes;
  simulation.write_snapshot(bytes);
  snapshot_ = std::make_shared<const Bytes>(std::move(bytes));
  snapshot_tick_ = simulation.current_tick();
}

void SimJournal::record_due_snapshot(const step::Simulation& simulation) {
  const Tick tick = simulation.current_tick();
  if (tick > kSnapshotPeriod && tick % kSnapshotPeriod == kSnapshotPhase)
    record_snapshot(simulation);
}

void SimJournal::add(std::shared_ptr<step::PublishedFrame> frame, const hands::TickInputs& inputs,
                     const step::TickDecisions& decisions, const step::TickReport& report) {
  records_.push_back({report.tick, decisions, inputs, report.state_hash});
  if (!frame) return;
  frame->records = std::exchange(records_, {});
  frame->snapshot = std::exchange(snapshot_, nullptr);
  frame->snapshot_tick = snapshot_tick_;
  while (recorder_->queued_bytes() > recording::Recorder::kQueueBytes / 2)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  recorder_->record_frame(std::move(frame));
}

}  // namespace trocar::app
