#include "server/app/sim/sim_journal.h"

#include <chrono>
#include <thread>
#include <utility>

namespace trocar::app {
namespace {

// A server takes its snapshots at the same ticks, see simulation_loop.cpp.
constexpr Tick kSnapshotPeriod = 10'000, kSnapshotPhase = kTicksPerFrame / 2;

}  // namespace

Result<std::unique_ptr<SimJournal>> SimJournal::create(const std::string& path,
                                                       const step::Simulation& simulation,
                                                       recording::Beginning beginning) {
  beginning.loads = simulation.loads().rules();
  beginning.threads = simulation.rules().threads;
  auto recorder =
      recording::Recorder::create(path, simulation.organ(), simulation.layout(), beginning);
  if (!recorder) return recorder.error();
  std::unique_ptr<SimJournal> journal(new SimJournal(std::move(*recorder)));
  journal->record_snapshot(simulation);
  return journal;
}

void SimJournal::wait_for_writer(std::size_t most_bytes) const {
  while (recorder_->queued_bytes() > most_bytes)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

// The writer has frames and lists in queues of their own: no frame may wait while a list comes.
void SimJournal::record_hands(std::vector<participants::Participant> hands, Tick tick) {
  wait_for_writer(0);
  recorder_->record_participants(std::move(hands), tick);
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
  wait_for_writer(recording::Recorder::kQueueBytes / 2);
  recorder_->record_frame(std::move(frame));
}

}  // namespace trocar::app
