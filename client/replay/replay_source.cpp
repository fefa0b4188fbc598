#include "client/replay/replay_source.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>

#include "client/replica/printable_message.h"
#include "client/replica/replica.h"
#include "common/base/ids.h"
#include "common/base/log.h"
#include "common/base/version.h"
#include "common/budget/message_budget.h"
#include "common/wire/fine_surface.h"
#include "common/wire/framing.h"
#include "proto/organ.pb.h"

namespace trocar::replay {
namespace {

using journal::JournalTopic;

constexpr std::size_t kMaxOrganBytes = 64 * 1024 * 1024;  // larger ones have no fine surface

// "1.0" -> 1; nothing if it is no number.
std::optional<std::uint32_t> major_of(const std::string& protocol) {
  std::uint32_t major = 0;
  const auto [end, error] =
      std::from_chars(protocol.data(), protocol.data() + protocol.size(), major);
  if (error != std::errc() || end == protocol.data() + protocol.size() || *end != '.')
    return std::nullopt;
  return major;
}

// Recordings of 0.1.0 may have a frame at a later time than its own, where somebody came or went
// while the disk was slow. It is left out, and the next keyframe goes on.
bool is_late(Tick tick, const JournalStream::Entry& entry) {
  return tick < entry.tick;
}

// A watcher's slot that nobody in the recording had, so that no tool seems to be ours.
std::uint32_t free_observer_slot(const journal::SessionInfo& info) {
  for (std::uint32_t slot = kMaxHands; slot < kMaxParticipants; ++slot)
    if (std::ranges::none_of(info.participants, [slot](const auto& p) { return p.slot() == slot; }))
      return slot;
  return kMaxParticipants - 1;
}

}  // namespace

Result<std::unique_ptr<ReplaySource>> ReplaySource::open(const std::string& path, Clock clock) {
  auto stream = JournalStream::open(path);
  if (!stream.ok()) return stream.error();
  const journal::SessionInfo& info = (*stream)->info();
  if (major_of(info.protocol) != kProtocolMajor)
    return Error{ErrorCode::BadFile, path + ": recorded with protocol '" + info.protocol +
                                         "', this client plays " + std::to_string(kProtocolMajor) +
                                         ".x: use the release that recorded it"};
  if (info.is_finished)
    log::info("{}: {}", path, info.summary);
  else
    log::warn("{}: {}", path, info.summary);
  if (info.gap_messages > 0)
    log::warn("{}: {} messages were dropped while recording; the picture stands still there", path,
              info.gap_messages);
  return std::unique_ptr<ReplaySource>(new ReplaySource(std::move(*stream), std::move(clock)));
}

ReplaySource::ReplaySource(std::unique_ptr<JournalStream> stream, Clock clock)
    : stream_(std::move(stream)),
      clock_(std::move(clock)),
      events_(stream_->path()),
      position_(stream_->first_tick()),
      seek_target_(stream_->first_tick()) {}

std::string ReplaySource::name() const {
  return std::filesystem::path(stream_->path()).filename().string();
}

void ReplaySource::poll(replica::MessageSink& sink) {
  if (state_ != replica::SourceState::Live) return;
  const std::uint64_t now = clock_();
  Status done;
  if (seek_target_) {
    const Tick target = *seek_target_;
    seek_target_.reset();
    set_pace(static_cast<double>(target), now);
    if (!has_welcomed_) {
      welcome(sink);
      deliver_fine_surface(sink);
    }
    done = run_seek(target, sink);
  } else if (is_playing_) {
    const Tick target = std::min(static_cast<Tick>(pace_tick(now)), last_tick());
    done = run_until(target, sink);
    if (target == last_tick()) is_playing_ = false;
  }
  if (done.ok()) return deliver_stage(sink);
  is_playing_ = false;
  state_ = replica::SourceState::Closed;
  close_reason_ = {replica::CloseKind::Lost, done.error().message};
}

bool ReplaySource::send(const proto::Envelope& message) {
  // The recording's own keyframes are all there is to heal with, and once cut its topologies.
  if (message.has_keyframe_request()) {
    needs_key_ = true;
    if (epoch_ > 0u) epoch_.reset();
  }
  return true;
}

void ReplaySource::close(const std::string& reason) {
  if (state_ == replica::SourceState::Closed) return;
  is_playing_ = false;
  state_ = replica::SourceState::Closed;
  close_reason_ = {replica::CloseKind::Ended, reason};
}

void ReplaySource::play() {
  if (is_playing_ || state_ != replica::SourceState::Live) return;
  if (seek_target_.value_or(position_) == last_tick()) seek_target_ = first_tick();
  is_playing_ = true;
  set_pace(static_cast<double>(position_), clock_());
}

void ReplaySource::pause() {
  is_playing_ = false;
}

void ReplaySource::seek(Tick tick) {
  if (state_ != replica::SourceState::Live) return;
  seek_target_ = std::clamp(tick, first_tick(), last_tick());
}

void ReplaySource::set_speed(float speed) {
  if (std::isnan(speed)) return;
  const std::uint64_t now = clock_();
  if (is_playing_) set_pace(pace_tick(now), now);
  speed_ = std::clamp(speed, kMinSpeed, kMaxSpeed);
}

void ReplaySource::set_pace(double tick, std::uint64_t now_ns) {
  pace_from_tick_ = tick;
  pace_from_ns_ = now_ns;
}

double ReplaySource::pace_tick(std::uint64_t now_ns) const {
  const std::uint64_t elapsed = now_ns > pace_from_ns_ ? now_ns - pace_from_ns_ : 0;
  const double ticks =
      static_cast<double>(elapsed) * double{speed_} / static_cast<double>(kTickNanoseconds);
  return std::min(pace_from_tick_ + ticks, static_cast<double>(last_tick()));
}

std::uint64_t ReplaySource::due_ns(Tick tick) const {
  const double after = (static_cast<double>(tick) - pace_from_tick_) *
                       static_cast<double>(kTickNanoseconds) / double{speed_};
  const auto offset = static_cast<std::uint64_t>(std::abs(after));
  if (after >= 0) return pace_from_ns_ + offset;
  return pace_from_ns_ > offset ? pace_from_ns_ - offset : 0;
}

void ReplaySource::welcome(replica::MessageSink& sink) {
  proto::Welcome& welcome = *other_.mutable_welcome();
  welcome.set_protocol_major(kProtocolMajor);
  welcome.set_protocol_minor(kProtocolMinor);
  welcome.set_sim_version(info().sim_version);
  welcome.set_participant(free_observer_slot(info()));
  welcome.set_organ_hash(info().organ_hash);
  welcome.set_tick_us(static_cast<std::uint32_t>(kTickNanoseconds / 1000));
  welcome.set_ticks_per_frame(static_cast<std::uint32_t>(kTicksPerFrame));
  deliver(other_, seek_target_.value_or(position_), sink);
  has_welcomed_ = true;
}

void ReplaySource::deliver_fine_surface(replica::MessageSink& sink) {
  const auto found = stream_->last_before(JournalTopic::Organ, first_tick());
  proto::Organ organ;
  if (!found || found->data.size() > kMaxOrganBytes) return;
  if (Status fits =
          check_budget(*proto::Organ::descriptor(), found->data, build_budget(found->data.size()));
      !fits.ok()) {
    log::warn("{}: organ: {}; it is drawn without a fine surface", stream_->path(),
              fits.error().message);
    return;
  }
  if (!organ.ParseFromArray(found->data.data(), static_cast<int>(found->data.size()))) return;
  if (!organ.has_fine_surface()) return;
  auto surface = wire::read(organ.fine_surface());
  if (!surface) {
    log::warn("{}: {}; the organ is drawn without it", stream_->path(), surface.error().message);
    return;
  }
  for (auto& part : wire::parts_of(*surface)) {
    other_.mutable_fine_surface_part()->Swap(&part);
    deliver(other_, first_tick(), sink);
  }
}

Status ReplaySource::run_seek(Tick target, replica::MessageSink& sink) {
  // Nobody yet is a list, too: it replaces that of a later time.
  proto::Participants& list = *other_.mutable_participants();
  list.Clear();
  if (const auto found = stream_->last_before(JournalTopic::Participants, target))
    if (Status parsed = parse(JournalTopic::Participants, found->tick, found->data, list);
        !parsed.ok())
      return parsed;
  deliver(other_, target, sink);
  // An empty drawing replaces another one, too.
  const auto drawing = stream_->last_before(JournalTopic::Drawing, target);
  if (Status done = deliver_lesson(JournalTopic::Drawing, target,
                                   drawing ? BytesView(drawing->data) : BytesView{}, sink);
      !done.ok())
    return done;

  constexpr Tick kHistoryTicks = replica::kHistoryFrames * kTicksPerFrame;
  states_from_ = target > kHistoryTicks ? target - kHistoryTicks : 0;
  held_state_.Clear();
  is_seeking_ = true;
  Status done = start_from_key(target, sink);
  if (done.ok()) done = run_until(target, sink);
  is_seeking_ = false;
  const proto::FrameState& held = held_state_.frame_state();
  if (done.ok() && held_state_.has_frame_state() && held.frame() == frame_)
    deliver(held_state_, held.tick(), sink);
  return done;
}

// Places the stream on the last keyframe at or before `target`, with its topology delivered.
Status ReplaySource::start_from_key(Tick target, replica::MessageSink& sink) {
  needs_key_ = true;
  const auto key = stream_->last_before(JournalTopic::SurfaceKey, target);
  const Tick from = key ? key->tick : target;
  stream_->rewind(from);
  if (key) {
    proto::SurfaceFrame& frame = *surface_.mutable_surface_frame();
    if (Status parsed = parse(JournalTopic::SurfaceKey, from, key->data, frame); !parsed.ok())
      return parsed;
    if (frame.epoch() == epoch_) return {};
  }
  if (const auto topology = stream_->last_before(JournalTopic::Topology, from))
    return deliver_topology(topology->tick, topology->data, sink);
  return {};
}

Status ReplaySource::run_until(Tick target, replica::MessageSink& sink) {
  while (true) {
    const auto entries = stream_->next_tick(target);
    if (!entries.ok()) return entries.error();
    if (entries->empty()) break;
    if (Status done = deliver_tick(*entries, sink); !done.ok()) return done;
  }
  position_ = target;
  return {};
}

// Messages come in the order of a live session, whatever that of the file.
Status ReplaySource::deliver_tick(Entries entries, replica::MessageSink& sink) {
  const auto each = [&](JournalTopic topic, auto&& visit) {
    Status done;
    for (const auto& entry : entries)
      if (entry.topic == topic && done.ok()) done = visit(entry);
    return done;
  };
  if (!is_seeking_) {
    const Status done = each(JournalTopic::Participants, [&](const auto& entry) {
      Status parsed =
          parse(entry.topic, entry.tick, stream_->bytes_of(entry), *other_.mutable_participants());
      if (parsed.ok()) deliver(other_, entry.tick, sink);
      return parsed;
    });
    if (!done.ok()) return done;
  }
  Status done = each(JournalTopic::TopologyChange,
                     [&](const auto& entry) { return deliver_change(entry, sink); });
  if (done.ok())
    done = each(JournalTopic::Topology, [&](const auto& entry) {
      return deliver_topology(entry.tick, stream_->bytes_of(entry), sink);
    });
  if (done.ok()) done = deliver_surface(entries, sink);
  if (done.ok())
    done = each(JournalTopic::FrameState,
                [&](const auto& entry) { return deliver_state(entry, sink); });
  if (done.ok() && !is_seeking_)
    done =
        each(JournalTopic::Claims, [&](const auto& entry) { return deliver_claims(entry, sink); });
  for (const auto topic : {JournalTopic::Lesson, JournalTopic::Drawing})
    if (done.ok() && !is_seeking_)
      done = each(topic, [&](const auto& entry) {
        return deliver_lesson(topic, entry.tick, stream_->bytes_of(entry), sink);
      });
  return done;
}

Status ReplaySource::deliver_topology(Tick tick, BytesView data, replica::MessageSink& sink) {
  proto::SurfaceTopology& topology = *other_.mutable_surface_topology();
  if (Status parsed = parse(JournalTopic::Topology, tick, data, topology); !parsed.ok())
    return parsed;
  if (epoch_ == topology.epoch()) return {};
  epoch_ = topology.epoch();
  needs_key_ = true;
  deliver(other_, tick, sink);
  return {};
}

// If it leads on from what the sink has. What a gap lacks, the next topology brings.
Status ReplaySource::deliver_change(const JournalStream::Entry& entry, replica::MessageSink& sink) {
  proto::SurfaceChange& change = *other_.mutable_surface_change();
  if (Status parsed = parse(entry.topic, entry.tick, stream_->bytes_of(entry), change);
      !parsed.ok())
    return parsed;
  if (epoch_ != change.from_epoch()) return {};
  // Before the sink sees it: its answer may be that it does not follow.
  epoch_ = change.epoch();
  deliver(other_, entry.tick, sink);
  return {};
}

// The delta if its baseline is what the sink has, else the keyframe, else nothing.
Status ReplaySource::deliver_surface(Entries entries, replica::MessageSink& sink) {
  proto::SurfaceFrame& frame = *surface_.mutable_surface_frame();
  for (const JournalTopic topic : {JournalTopic::SurfaceDelta, JournalTopic::SurfaceKey}) {
    const bool is_key = topic == JournalTopic::SurfaceKey;
    for (const auto& entry : entries) {
      if (entry.topic != topic) continue;
      if (Status parsed = parse(topic, entry.tick, stream_->bytes_of(entry), frame); !parsed.ok())
        return parsed;
      if (frame.tick() > entry.tick || frame.is_keyframe() != is_key)
        return stream_->malformed(topic, entry.tick, "is a frame of another kind or tick");
      if (is_key && needs_key_ && frame.epoch() != epoch_)
        if (const auto topology = stream_->last_before(JournalTopic::Topology, entry.tick))
          if (Status done = deliver_topology(topology->tick, topology->data, sink); !done.ok())
            return done;
      if (frame.epoch() != epoch_ || is_late(frame.tick(), entry)) continue;
      if (is_key ? !needs_key_ && frame.frame() <= frame_
                 : needs_key_ || frame.base_frame() != frame_)
        continue;
      frame_ = frame.frame();
      // Before the sink sees it: its answer may be that it needs another.
      needs_key_ = false;
      deliver(surface_, entry.tick, sink);
      return {};
    }
  }
  const bool has_delta = std::ranges::any_of(
      entries, [](const auto& entry) { return entry.topic == JournalTopic::SurfaceDelta; });
  if (has_delta) needs_key_ = true;
  return {};
}

Status ReplaySource::deliver_state(const JournalStream::Entry& entry, replica::MessageSink& sink) {
  proto::FrameState& state = *state_message_.mutable_frame_state();
  if (Status parsed = parse(entry.topic, entry.tick, stream_->bytes_of(entry), state); !parsed.ok())
    return parsed;
  if (state.tick() > entry.tick)
    return stream_->malformed(entry.topic, entry.tick, "is of another tick");
  if (is_late(state.tick(), entry)) return {};
  if (state.frame() != frame_ || needs_key_) return {};
  if (is_seeking_ && entry.tick < states_from_)
    held_state_.Swap(&state_message_);
  else
    deliver(state_message_, entry.tick, sink);
  return {};
}

Status ReplaySource::deliver_claims(const JournalStream::Entry& entry, replica::MessageSink& sink) {
  proto::ClaimLog claims;
  if (Status parsed = parse(entry.topic, entry.tick, stream_->bytes_of(entry), claims);
      !parsed.ok())
    return parsed;
  for (proto::ClaimEvent& event : *claims.mutable_event()) {
    other_.mutable_claim_event()->Swap(&event);
    deliver(other_, entry.tick, sink);
  }
  return {};
}

Status ReplaySource::deliver_lesson(JournalTopic topic, Tick tick, BytesView data,
                                    replica::MessageSink& sink) {
  if (topic == JournalTopic::Drawing) {
    if (Status parsed = parse(topic, tick, data, *other_.mutable_drawing()); !parsed.ok())
      return parsed;
    deliver(other_, tick, sink);
    return {};
  }
  proto::LessonRecord record;
  if (Status parsed = parse(topic, tick, data, record); !parsed.ok()) return parsed;
  if (record.has_teach())
    other_.mutable_teach_event()->Swap(record.mutable_teach());
  else if (record.has_point())
    other_.mutable_point_event()->Swap(record.mutable_point());
  else if (record.has_view())
    other_.mutable_view_event()->Swap(record.mutable_view());
  else
    return {};
  deliver(other_, tick, sink);
  return {};
}

void ReplaySource::deliver_stage(replica::MessageSink& sink) {
  const auto told = events_.story();
  if (!told) return;
  const RecordedStage* now = told->stage_at(position_);
  if (now == stage_) return;
  stage_ = now;
  auto& message = *other_.mutable_lesson_stage();
  message.Clear();
  if (now != nullptr) message = now->stage;
  deliver(other_, position_, sink);
}

std::shared_ptr<const replica::PlaybackStory> ReplaySource::story() const {
  auto told = events_.story();
  if (!told) return nullptr;
  return {told, &told->story};
}

Status ReplaySource::parse(JournalTopic topic, Tick tick, BytesView data,
                           google::protobuf::Message& message) const {
  if (data.size() > wire::kMaxDownstreamBytes ||
      !message.ParseFromArray(data.data(), static_cast<int>(data.size())))
    return stream_->malformed(topic, tick, "is malformed");
  return {};
}

void ReplaySource::deliver(proto::Envelope& message, Tick tick, replica::MessageSink& sink) {
  const std::size_t bytes = message.ByteSizeLong() + wire::kHeaderBytes;
  statistics_.bytes_received += bytes;
  ++statistics_.messages_received;
  if (message.has_surface_frame()) ++statistics_.frames_received;
  replica::make_printable(message);
  sink.on_message(message, due_ns(tick), bytes);
}

}  // namespace trocar::replay
