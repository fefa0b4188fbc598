#pragma once

// A recorded session as a source of messages: what a client that joined it as an observer was sent,
// in the order it was sent, at the pace of the player's choice.
//
//   journal -> JournalStream (a tick at a time, one second read ahead) -> poll(sink)
//
// Start and seek deliver: Welcome (once), Participants as of then, SurfaceTopology if the epoch
// differs, the last keyframe at or before the target, every delta up to it, FrameState of the last
// 128 ms and in any case of the last frame. Claims that a seek passes over are not repeated. Then
// each tick's messages follow as they fall due: surface changes, deltas, and the 1 Hz keyframes
// only where a delta's baseline is missing (the recorder fell behind, a chunk is damaged) or the
// sink sent a KeyframeRequest; then the topology goes before it. Until such a keyframe the picture
// stands still.
//
// The file is outside data. A message that does not parse, or contradicts its own topic or tick,
// closes the source: CloseKind::Lost, one line that names file, topic and tick. What the numbers
// mean is the replica's to check, as with a server. At the end of the file it pauses and stays
// Live. Frames are delivered with the time at which they fell due, those of a seek as if they had
// been played up to it. Thread: the render thread; a poll reads at most what it delivers and one
// second more.

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "client/replay/journal_stream.h"
#include "client/replay/recorded_events.h"
#include "client/replica/session_source.h"
#include "common/base/timing.h"
#include "proto/wire.pb.h"

namespace trocar::replay {

inline constexpr float kMinSpeed = 0.1f, kMaxSpeed = 16.0f;

class ReplaySource final : public replica::SessionSource, public replica::PlaybackControl {
 public:
  using Clock = std::function<std::uint64_t()>;  // ns, never decreasing

  // Plays from the first poll() on, at speed 1. An unfinished recording opens like any other; what
  // could be recovered of it goes to the log.
  static Result<std::unique_ptr<ReplaySource>> open(const std::string& path,
                                                    Clock clock = monotonic_ns);

  const journal::SessionInfo& info() const { return stream_->info(); }

  void poll(replica::MessageSink& sink) override;
  bool send(const proto::Envelope& message) override;
  void close(const std::string& reason) override;
  replica::SourceState state() const override { return state_; }
  replica::CloseReason close_reason() const override { return close_reason_; }
  replica::SourceStatistics statistics() const override { return statistics_; }
  std::string name() const override;
  replica::PlaybackControl* playback() override { return this; }

  Tick first_tick() const override { return stream_->first_tick(); }
  Tick last_tick() const override { return stream_->last_tick(); }
  Tick position() const override { return position_; }
  bool is_playing() const override { return is_playing_; }
  float speed() const override { return speed_; }
  void play() override;
  void pause() override;
  void seek(Tick tick) override;
  void set_speed(float speed) override;
  std::shared_ptr<const replica::PlaybackStory> story() const override;
  // With the stages of a lesson; null until the file is read.
  std::shared_ptr<const RecordedStory> recorded_story() const { return events_.story(); }

 private:
  using Entries = std::span<const JournalStream::Entry>;

  ReplaySource(std::unique_ptr<JournalStream> stream, Clock clock);
  void set_pace(double tick, std::uint64_t now_ns);
  double pace_tick(std::uint64_t now_ns) const;
  std::uint64_t due_ns(Tick tick) const;
  void welcome(replica::MessageSink& sink);
  // Hands on the organ's fine surface, if it has one that can be read.
  void deliver_fine_surface(replica::MessageSink& sink);
  Status run_seek(Tick target, replica::MessageSink& sink);
  Status run_until(Tick target, replica::MessageSink& sink);
  Status start_from_key(Tick target, replica::MessageSink& sink);
  Status deliver_tick(Entries entries, replica::MessageSink& sink);
  Status deliver_topology(Tick tick, BytesView data, replica::MessageSink& sink);
  Status deliver_change(const JournalStream::Entry& entry, replica::MessageSink& sink);
  Status deliver_surface(Entries entries, replica::MessageSink& sink);
  Status deliver_state(const JournalStream::Entry& entry, replica::MessageSink& sink);
  // Hands on a Drawing where `topic` is that, else what a LessonRecord holds.
  Status deliver_lesson(journal::JournalTopic topic, Tick tick, BytesView data,
                        replica::MessageSink& sink);
  // Says which stage of a lesson was on, where it is another one than the sink was told of. The
  // stages are known once the file is read.
  void deliver_stage(replica::MessageSink& sink);
  Status deliver_claims(const JournalStream::Entry& entry, replica::MessageSink& sink);
  Status parse(journal::JournalTopic topic, Tick tick, BytesView data,
               google::protobuf::Message& message) const;
  // Makes its texts printable: anybody may have written the recording.
  void deliver(proto::Envelope& message, Tick tick, replica::MessageSink& sink);

  std::unique_ptr<JournalStream> stream_;
  Clock clock_;
  RecordedEvents events_;
  replica::SourceState state_ = replica::SourceState::Live;
  replica::CloseReason close_reason_;
  replica::SourceStatistics statistics_;

  bool is_playing_ = true;
  float speed_ = 1;
  Tick position_ = 0;
  std::optional<Tick> seek_target_;  // done by the next poll
  double pace_from_tick_ = 0;        // play has reached this tick
  std::uint64_t pace_from_ns_ = 0;   // at this time

  // The members below say what the sink holds.
  bool has_welcomed_ = false;
  const RecordedStage* stage_ = nullptr;
  std::optional<std::uint32_t> epoch_;  // none: it needs a topology, too
  Frame frame_ = 0;
  bool needs_key_ = true;

  bool is_seeking_ = false;
  Tick states_from_ = 0;        // of a seek: states before this tick are held back
  proto::Envelope held_state_;  // the latest of those
  proto::Envelope surface_, state_message_, other_;  // kept for their memory
};

}  // namespace trocar::replay
