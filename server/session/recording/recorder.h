#pragma once

// Writes a session's journal from a thread of its own.
//
//   simulation thread: record_frame ----> [frames, 8 MiB] --.
//   I/O thread:        record_participants -> [64 lists] -----+--> writer thread -> MCAP file
//   I/O thread:        record_hand ------> [512 reports] -----+
//   I/O thread:        record_lesson ----> [256 entries] -----'
//
// Neither producer ever waits. When the frames' queue is full a frame is dropped, counted, and the
// journal gets a JournalGap with the ticks that are missing; the surface goes on with topology and
// keyframe (what a dropped frame changed of it is kept) and re-simulation from the next snapshot. A
// disk error ends the recording, is logged once, and close() returns it. Both show in state() at
// once, so that the session can tell everybody.
//
// Each second the writer thread brings the file to the disk (fdatasync), so that a loss of power
// takes about that much. While a disk is busy with it, what comes waits in the queues.
//
// Every 30 s an Overview follows, in a chunk of its own.
//
// Changes of the surface are written with their frame. From epoch 1 on each keyframe (1 Hz) follows
// a full SurfaceTopology of its tick, so that a seek, or what comes after damage, starts right.

#include <algorithm>
#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "common/base/spsc_queue.h"
#include "common/journal/session_journal_writer.h"
#include "common/secure/signing.h"
#include "common/wire/hand_report.h"
#include "common/wire/lesson.h"
#include "common/wire/recording_state.h"
#include "common/wire/surface_layout.h"
#include "server/organs/organ/organ.h"
#include "server/session/participants/roster.h"
#include "server/session/recording/frame_messages.h"
#include "server/session/recording/overview.h"
#include "server/tissue/bleeding/rules.h"
#include "server/tissue/step/external_loads.h"
#include "server/tissue/step/published_frame.h"
#include "server/tissue/thread/rules.h"

namespace trocar::recording {

struct RecorderCounters {
  std::uint64_t frames_written = 0, frames_dropped = 0, bytes_written = 0;
};

// How a recording begins.
struct Beginning {
  step::LoadRules loads;  // of a scenario
  // The state at the start is not that of the organ at rest: the first snapshot says what it is.
  bool starts_from_snapshot = false;
  bool has_implicit_strain = false;                // of a scenario, see journal::SessionInfo
  std::optional<journal::Continuation> continues;  // with which journal's session it goes on
  std::optional<bleeding::Rules> bleeding;         // of a session that bleeds
  std::optional<thread::Rules> threads;            // of one with surgical thread
  std::optional<secure::SigningKey> key;           // signs the recording at its end
};

class Recorder {
 public:
  static constexpr std::size_t kQueueBytes = 8 * 1024 * 1024;
  static constexpr std::size_t kQueueFrames = 1024;
  static constexpr std::size_t kQueueParticipants = 64;
  static constexpr std::size_t kQueueHands = 512;    // 2 s of 32 tools
  static constexpr std::size_t kQueueLessons = 256;  // 5 s of two who point

  // Chunks end each 250 ms, so every fourth is followed by a sync though the clock is not exact.
  static constexpr std::uint64_t kSyncNs = 875'000'000;

  // Creates the file with organ and topology; copies what it keeps. Fails if the file exists or
  // cannot be written.
  static Result<std::unique_ptr<Recorder>> create(
      const std::string& path, const organ::Organ& organ, const wire::SurfaceLayout& layout,
      const Beginning& beginning = {}, journal::McapWriterOptions options = {.sync_ns = kSyncNs});
  ~Recorder();

  // Simulation thread.
  void record_frame(const step::SharedFrame& frame);
  // A producer that can wait asks: near kQueueBytes the next frame may be dropped.
  std::size_t queued_bytes() const { return queued_bytes_.load(std::memory_order_relaxed); }
  // The I/O thread calls it after each change.
  void record_participants(std::vector<participants::Participant> present, Tick tick);
  // The I/O thread calls it. What does not fit is left out, and the next that fits says how many.
  void record_hand(wire::HandRecord record);
  // The I/O thread calls it; likewise.
  void record_lesson(wire::LessonEntry entry);
  // I/O thread, before close(): what is queued is written, and the file's summary; nothing after
  // that. The recording counts as failed, for this reason. Only the first call counts.
  void end_early(const std::string& reason);
  // After both producers have ended: writes what is queued and the file's summary.
  Status close();
  // After close().
  const RecorderCounters& counters() const { return counters_; }
  // Any thread may call these at any time.
  wire::RecordingState state() const;
  std::uint64_t sync_count() const { return sync_count_.load(std::memory_order_relaxed); }

 private:
  struct Presence {
    std::vector<participants::Participant> present;
    Tick tick = 0;
  };
  struct QueuedLesson {
    wire::LessonEntry entry;
    std::uint64_t left_out = 0;  // before it
  };
  struct Gap {
    Tick first_tick = 0, last_tick = 0;
    std::uint64_t frames = 0;
    std::shared_ptr<const wire::SurfaceLayout> new_layout;  // before `changes`
    std::vector<std::shared_ptr<const wire::SurfaceChange>> changes;
  };
  struct QueuedFrame {
    step::SharedFrame frame;
    std::size_t bytes = 0;
    Gap gap_before;  // frames dropped just before this one
  };

  Recorder(std::unique_ptr<journal::SessionJournalWriter> writer, const organ::Organ& organ,
           std::uint64_t organ_hash, const wire::SurfaceLayout& layout, Tick begin_tick,
           std::optional<secure::SigningKey> key);
  void run();
  // Writes everything queued; false when all queues were empty.
  bool write_queued();
  Status write_presence(const Presence& presence);
  Status write_hand(const wire::HandRecord& record);
  Status write_lesson(const QueuedLesson& lesson);
  Status write_gap(const Gap& gap);
  Status write_frame(const step::PublishedFrame& frame);
  Status write_overview();
  void fail_with(const Error& error);
  // Writes what a whole file ends with.
  Status finish_file();
  Status close_file() { return writer_->close(key_ ? &*key_ : nullptr); }
  Tick not_before_last(Tick tick) { return last_tick_ = std::max(last_tick_, tick); }

  // Writer thread, or the caller's after it has ended.
  std::unique_ptr<journal::SessionJournalWriter> writer_;
  participants::Roster roster_;  // names for claim events
  FrameMessages messages_;
  OverviewBuilder overview_;
  Tick last_tick_ = 0;
  std::uint64_t organ_hash_ = 0;
  const std::optional<secure::SigningKey> key_;
  RecorderCounters counters_;
  Status status_;
  std::atomic<bool> has_failed_{false};  // status_ is an error, and changes no more
  bool is_finished_ = false;             // the file has its summary
  std::string early_reason_;             // I/O thread, until `ends_early_`
  std::atomic<bool> ends_early_{false};

  std::atomic<std::uint64_t> frames_dropped_{0}, sync_count_{0};
  SpscQueue<QueuedFrame> frames_{kQueueFrames};
  SpscQueue<Presence> presences_{kQueueParticipants};
  SpscQueue<wire::HandRecord> hands_{kQueueHands};
  SpscQueue<QueuedLesson> lessons_{kQueueLessons};
  std::uint64_t hands_left_out_ = 0, lessons_left_out_ = 0;  // I/O thread
  std::atomic<std::size_t> queued_bytes_{0};
  Gap open_gap_;  // simulation thread
  std::atomic<std::uint32_t> wake_ups_{0};
  std::atomic<bool> is_closing_{false};
  std::thread thread_;
};

}  // namespace trocar::recording
