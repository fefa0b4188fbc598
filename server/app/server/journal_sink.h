#pragma once

// A session is recorded through this sink: it is the seam between the server's threads and its
// journal. Nothing here may block: an implementation queues and lets a thread of its own write.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/journal/session_topics.h"
#include "common/secure/signing.h"
#include "common/wire/hand_report.h"
#include "common/wire/lesson.h"
#include "common/wire/recording_state.h"
#include "common/wire/surface_layout.h"
#include "server/organs/organ/organ.h"
#include "server/session/participants/roster.h"
#include "server/tissue/step/published_frame.h"
#include "server/tissue/step/tick.h"

namespace trocar::app {

class JournalSink {
 public:
  virtual ~JournalSink() = default;
  // Simulation thread: every published frame, with records of its ticks and, now and then, a
  // snapshot. The first frame has the snapshot of tick 0.
  virtual void record_frame(const step::SharedFrame& frame) = 0;
  // I/O thread: who is here, after each change. `tick` is that of the newest frame.
  virtual void record_participants(const std::vector<participants::Participant>& present,
                                   Tick tick) = 0;
  // I/O thread: what a hand has felt.
  virtual void record_hand(wire::HandRecord record) = 0;
  // I/O thread: what people have said and shown.
  virtual void record_lesson(wire::LessonEntry entry) = 0;
  // I/O thread: what has been taken is written, with an index, and nothing more. `reason` is said.
  virtual void end_early(const std::string& /*reason*/) {}
  // Any thread may ask how many bytes were taken and are not written yet.
  virtual std::size_t queued_bytes() const { return 0; }
  // Any thread may ask how often what was written was brought to the disk.
  virtual std::uint64_t sync_count() const { return 0; }
  // I/O thread, after the simulation thread has ended.
  virtual Status close() = 0;
  // Any thread, at any time: whether everything has been recorded so far.
  virtual wire::RecordingState state() const = 0;
};

// A journal at `path`, or none for "none" (then null). continues: with which journal's session it
// goes on. rules: what of them a recording keeps. key: signs the recording at its end.
Result<std::unique_ptr<JournalSink>> open_journal(
    const std::string& path, const organ::Organ& organ, const wire::SurfaceLayout& layout,
    const std::optional<journal::Continuation>& continues = {}, const step::SceneRules& rules = {},
    const std::optional<secure::SigningKey>& key = {});

// "./trocar-20261121T135400Z.mcap"
std::string default_journal_path();

}  // namespace trocar::app
