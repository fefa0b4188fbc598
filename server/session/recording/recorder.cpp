#include "server/session/recording/recorder.h"

#include "common/base/log.h"
#include "common/base/timing.h"
#include "common/base/version.h"
#include "common/wire/hand_report_messages.h"
#include "common/wire/surface_messages.h"
#include "server/organs/organ/organ_file.h"
#include "server/session/recording/bleeding_messages.h"
#include "server/session/recording/load_messages.h"
#include "server/session/recording/thread_messages.h"
#include "server/session/replication/messages.h"

namespace trocar::recording {
namespace {

std::size_t estimated_bytes(const step::PublishedFrame& frame) {
  std::size_t bytes = sizeof frame + frame.surface.size() * sizeof(wire::QuantisedVertex) +
                      frame.regions.size() * sizeof(std::uint16_t);
  bytes += frame.blood.size() + frame.threads.size();
  if (frame.snapshot) bytes += frame.snapshot->size();
  if (frame.change)
    bytes += frame.change->new_vertices.size() * sizeof(wire::NewVertex) +
             frame.change->removed.size() * sizeof(TriangleIndex) +
             frame.change->added.size() * sizeof(wire::NewTriangle);
  for (const auto& record : frame.records)
    bytes += sizeof record + record.inputs.samples.size() * sizeof(hands::ToolInput);
  return bytes;
}

class FileSink final : public MessageSink {
 public:
  FileSink(journal::SessionJournalWriter& writer, Tick tick, std::uint64_t now_ns)
      : writer_(writer), tick_(tick), now_ns_(now_ns) {}
  Status write(journal::JournalTopic topic, const google::protobuf::Message& message) override {
    return writer_.write(topic, tick_, now_ns_, message);
  }
  Status write(const proto::ToolState& tool) override {
    return writer_.write_tool({static_cast<std::uint8_t>(tool.tool())}, tick_, now_ns_, tool);
  }

 private:
  journal::SessionJournalWriter& writer_;
  Tick tick_;
  std::uint64_t now_ns_;
};

}  // namespace

Result<std::unique_ptr<Recorder>> Recorder::create(const std::string& path,
                                                   const organ::Organ& organ,
                                                   const wire::SurfaceLayout& layout,
                                                   const Beginning& beginning,
                                                   journal::McapWriterOptions options) {
  const Tick begin_tick = beginning.continues ? beginning.continues->tick : 0;
  const std::uint64_t now = utc_ns();
  const std::uint64_t hash = organ::organ_hash(organ);
  auto writer =
      journal::SessionJournalWriter::create(path,
                                            {.start_utc_ns = now - begin_tick * kTickNanoseconds,
                                             .organ_name = organ.name,
                                             .organ_hash = hash,
                                             .has_external_loads = !beginning.loads.empty(),
                                             .starts_from_snapshot = beginning.starts_from_snapshot,
                                             .has_implicit_strain = beginning.has_implicit_strain,
                                             .continues = beginning.continues},
                                            options);
  if (!writer) return writer.error();
  if (auto s = (*writer)->write(journal::JournalTopic::Organ, 0, now, organ::encode_organ(organ));
      !s)
    return s.error();
  if (!beginning.loads.empty()) {
    proto::ExternalLoads loads;
    to_message(beginning.loads, loads);
    if (auto s = (*writer)->write(journal::JournalTopic::Loads, begin_tick, now, loads); !s)
      return s.error();
  }
  if (beginning.bleeding) {
    proto::BleedingRules rules;
    to_message(*beginning.bleeding, rules);
    if (auto s = (*writer)->write(journal::JournalTopic::Bleeding, begin_tick, now, rules); !s)
      return s.error();
  }
  if (beginning.threads) {
    proto::ThreadRules rules;
    to_message(*beginning.threads, rules);
    if (auto s = (*writer)->write(journal::JournalTopic::Threads, begin_tick, now, rules); !s)
      return s.error();
  }
  proto::SurfaceTopology topology;
  wire::write(layout, organ.name, topology);
  if (auto s = (*writer)->write_topology(begin_tick, now, topology); !s) return s.error();
  if (auto s = (*writer)->flush(); !s) return s.error();
  return std::unique_ptr<Recorder>(
      new Recorder(std::move(*writer), organ, hash, layout, begin_tick, beginning.key));
}

Recorder::Recorder(std::unique_ptr<journal::SessionJournalWriter> writer, const organ::Organ& organ,
                   std::uint64_t organ_hash, const wire::SurfaceLayout& layout, Tick begin_tick,
                   std::optional<secure::SigningKey> key)
    : writer_(std::move(writer)),
      messages_(organ.name, layout),
      overview_(begin_tick),
      last_tick_(begin_tick),
      organ_hash_(organ_hash),
      key_(std::move(key)),
      thread_([this] { run(); }) {}

Recorder::~Recorder() {
  if (thread_.joinable()) static_cast<void>(close());
}

void Recorder::record_frame(const step::SharedFrame& frame) {
  const std::size_t bytes = estimated_bytes(*frame);
  const Tick first = frame->records.empty() ? frame->tick : frame->records.front().tick;
  bool is_taken = queued_bytes_.load(std::memory_order_relaxed) + bytes <= kQueueBytes;
  if (is_taken) {
    queued_bytes_.fetch_add(bytes, std::memory_order_relaxed);
    is_taken = frames_.try_push({frame, bytes, open_gap_});
    if (!is_taken) queued_bytes_.fetch_sub(bytes, std::memory_order_relaxed);
  }
  if (is_taken) {
    open_gap_ = {};
  } else {
    frames_dropped_.fetch_add(1, std::memory_order_relaxed);
    if (open_gap_.frames++ == 0) open_gap_.first_tick = first;
    open_gap_.last_tick = frame->tick;
    if (frame->new_layout) {
      open_gap_.new_layout = frame->new_layout;
      open_gap_.changes.clear();
    }
    if (frame->change) open_gap_.changes.push_back(frame->change);
  }
  wake_ups_.fetch_add(1);
  wake_ups_.notify_one();
}

void Recorder::record_participants(std::vector<participants::Participant> present, Tick tick) {
  // A list that does not fit is replaced by the next one; 64 changes would have to come at once.
  static_cast<void>(presences_.try_push({std::move(present), tick}));
  wake_ups_.fetch_add(1);
  wake_ups_.notify_one();
}

void Recorder::record_hand(wire::HandRecord record) {
  record.left_out = hands_left_out_;
  const bool is_taken = hands_.try_push(std::move(record));
  hands_left_out_ = is_taken ? 0 : hands_left_out_ + 1;
  wake_ups_.fetch_add(1);
  wake_ups_.notify_one();
}

void Recorder::record_lesson(wire::LessonEntry entry) {
  const bool is_taken = lessons_.try_push({std::move(entry), lessons_left_out_});
  lessons_left_out_ = is_taken ? 0 : lessons_left_out_ + 1;
  wake_ups_.fetch_add(1);
  wake_ups_.notify_one();
}

void Recorder::run() {
  for (;;) {
    const auto seen = wake_ups_.load();
    const bool is_closing = is_closing_.load();
    const bool ends_early = ends_early_.load(std::memory_order_acquire) && status_.ok();
    if (write_queued() && !ends_early) continue;
    if (ends_early) {
      const Status finished = finish_file();
      fail_with(finished ? Error{ErrorCode::ResourceMissing, early_reason_} : finished.error());
      continue;
    }
    if (is_closing) return;
    wake_ups_.wait(seen);
  }
}

bool Recorder::write_queued() {
  bool any = false;
  while (auto presence = presences_.try_pop()) {
    any = true;
    if (!status_.ok()) continue;
    if (auto s = write_presence(*presence); !s) fail_with(s.error());
  }
  while (const auto record = hands_.try_pop()) {
    any = true;
    if (!status_.ok()) continue;
    if (auto s = write_hand(*record); !s) fail_with(s.error());
  }
  while (const auto lesson = lessons_.try_pop()) {
    any = true;
    if (!status_.ok()) continue;
    if (auto s = write_lesson(*lesson); !s) fail_with(s.error());
  }
  while (auto queued = frames_.try_pop()) {
    any = true;
    if (status_.ok()) {
      Status s = queued->gap_before.frames > 0 ? write_gap(queued->gap_before) : Status{};
      if (s.ok()) s = write_frame(*queued->frame);
      if (!s) fail_with(s.error());
    }
    queued_bytes_.fetch_sub(queued->bytes, std::memory_order_relaxed);
  }
  sync_count_.store(writer_->sync_count(), std::memory_order_relaxed);
  return any;
}

void Recorder::end_early(const std::string& reason) {
  if (ends_early_.load(std::memory_order_relaxed)) return;
  early_reason_ = reason;
  ends_early_.store(true, std::memory_order_release);
  wake_ups_.fetch_add(1);
  wake_ups_.notify_one();
}

Status Recorder::finish_file() {
  is_finished_ = true;
  if (!overview_.is_empty())
    if (auto s = write_overview(); !s) return s;
  return close_file();
}

void Recorder::fail_with(const Error& error) {
  status_ = error;
  has_failed_.store(true, std::memory_order_release);
  log::error("recording ends here: {}", error.message);
}

Status Recorder::write_presence(const Presence& presence) {
  roster_ = participants::Roster(presence.present);
  proto::Participants message;
  replication::describe(presence.present, message);
  // Frames that still wait may not become younger by it: then it goes with the one before them.
  const bool has_waiting = queued_bytes() > 0;
  const Tick tick = has_waiting ? last_tick_ : not_before_last(presence.tick);
  overview_.add_presence(tick, message);
  return writer_->write_participants(tick, utc_ns(), message);
}

Status Recorder::write_hand(const wire::HandRecord& record) {
  proto::HandLog message;
  wire::write(record, message);
  // With the frame that was written last: frames that still wait may not become younger by it.
  return writer_->write_hands(last_tick_, utc_ns(), message);
}

Status Recorder::write_lesson(const QueuedLesson& lesson) {
  const auto& [kind, message] = lesson.entry;
  // With the frame that was written last, as hands are.
  const Tick written = last_tick_;
  if (kind == wire::LessonKind::Drawing)
    return writer_->write(journal::JournalTopic::Drawing, written, utc_ns(), message);
  proto::LessonRecord record;
  record.ParseFromArray(message.data(), static_cast<int>(message.size()));
  if (record.has_teach()) overview_.add_lesson(record.teach());
  if (record.has_stage()) overview_.add_stage(written, record.stage());
  if (lesson.left_out == 0)
    return writer_->write(journal::JournalTopic::Lesson, written, utc_ns(), message);
  record.set_left_out(lesson.left_out);
  return writer_->write(journal::JournalTopic::Lesson, written, utc_ns(), record);
}

Status Recorder::write_gap(const Gap& gap) {
  if (auto s = messages_.skip(gap.new_layout.get(), gap.changes); !s) return s;
  counters_.frames_dropped += gap.frames;
  log::warn("recording: the disk was too slow, ticks {} to {} are missing", gap.first_tick,
            gap.last_tick);
  proto::JournalGap message;
  message.set_first_tick(gap.first_tick);
  message.set_last_tick(gap.last_tick);
  message.set_messages(gap.frames);
  overview_.add_gap(message);
  if (auto s = writer_->write_gap(not_before_last(gap.last_tick), utc_ns(), message); !s) return s;
  if (!overview_.is_behind(gap.last_tick)) return {};
  if (auto s = write_overview(); !s) return s;
  overview_.skip_to(gap.last_tick);
  return {};
}

Status Recorder::write_frame(const step::PublishedFrame& frame) {
  const std::uint64_t now = utc_ns();
  if (frame.snapshot) {
    proto::WorldSnapshot message;
    message.set_tick(frame.snapshot_tick);
    message.set_sim_version(kSimVersion);
    message.set_organ_hash(organ_hash_);
    message.set_state_hash(xxh3_64(*frame.snapshot));
    message.set_state(frame.snapshot->data(), frame.snapshot->size());
    if (auto s = writer_->write_snapshot(not_before_last(frame.snapshot_tick), now, message); !s)
      return s;
  }
  FileSink sink(*writer_, not_before_last(frame.tick), now);
  if (auto s = messages_.write(frame, roster_, sink); !s) return s;
  ++counters_.frames_written;
  overview_.add_frame(frame, roster_);
  return overview_.is_full() ? write_overview() : Status{};
}

Status Recorder::write_overview() {
  return writer_->write_overview(last_tick_, utc_ns(), overview_.take());
}

wire::RecordingState Recorder::state() const {
  wire::RecordingState state{.status = wire::RecordingStatus::Whole,
                             .frames_missing = frames_dropped_.load(std::memory_order_relaxed),
                             .text = {}};
  if (has_failed_.load(std::memory_order_acquire)) {
    state.status = wire::RecordingStatus::Failed;
    state.text = "the recording has ended: " + status_.error().message;
  } else if (state.frames_missing > 0) {
    state.status = wire::RecordingStatus::Gapped;
    state.text = "the recording has gaps: " + std::to_string(state.frames_missing) +
                 " frames are missing, the disk was too slow";
  }
  return state;
}

Status Recorder::close() {
  is_closing_.store(true);
  wake_ups_.fetch_add(1);
  wake_ups_.notify_one();
  thread_.join();
  if (open_gap_.frames > 0 && status_.ok()) {
    if (auto s = write_gap(open_gap_); !s) fail_with(s.error());
  }
  if (!overview_.is_empty() && status_.ok()) {
    if (auto s = write_overview(); !s) fail_with(s.error());
  }
  if (hands_left_out_ > 0)
    log::warn("recording: the last {} reports of what hands felt are missing", hands_left_out_);
  if (lessons_left_out_ > 0)
    log::warn("recording: the last {} things that people said or showed are missing",
              lessons_left_out_);
  const Status closed = is_finished_ ? Status{} : close_file();
  if (status_.ok() && !closed.ok()) fail_with(closed.error());
  counters_.bytes_written = writer_->bytes_written();
  return status_;
}

}  // namespace trocar::recording
