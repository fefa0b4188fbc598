#pragma once

// The journal of a scenario: the same file as a session's, written as fast as the ticks are
// computed. Where the disk is slower the ticks wait, so that no frame is dropped. One thread.

#include <memory>
#include <string>
#include <vector>

#include "common/journal/session_topics.h"
#include "server/session/participants/roster.h"
#include "server/session/recording/recorder.h"
#include "server/tissue/step/simulation.h"

namespace trocar::app {

class SimJournal {
 public:
  // Fails if the file exists. The simulation is at tick 0 and has the loads of the recording.
  static Result<std::unique_ptr<SimJournal>> create(const std::string& path,
                                                    const step::Simulation& simulation,
                                                    recording::Beginning beginning);

  // Before a tick: from then on these are there.
  void record_hands(std::vector<participants::Participant> hands, Tick tick);
  // After each tick, with what it was told and the frame that it published, or null.
  void add(std::shared_ptr<step::PublishedFrame> frame, const hands::TickInputs& inputs,
           const step::TickDecisions& decisions, const step::TickReport& report);
  // After it; a snapshot goes with the next frame.
  void record_due_snapshot(const step::Simulation& simulation);
  // Ticks after the last frame are not in the journal.
  Status close() { return recorder_->close(); }

 private:
  explicit SimJournal(std::unique_ptr<recording::Recorder> recorder)
      : recorder_(std::move(recorder)) {}
  void record_snapshot(const step::Simulation& simulation);
  void wait_for_writer(std::size_t most_bytes) const;

  std::unique_ptr<recording::Recorder> recorder_;
  std::vector<step::TickRecord> records_;  // since the last frame
  std::shared_ptr<const Bytes> snapshot_;  // waits for the next frame
  Tick snapshot_tick_ = 0;
};

}  // namespace trocar::app
