#include "common/journal/session_journal.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <set>

#include "common/base/printable.h"
#include "common/budget/message_budget.h"
#include "common/journal/mcap_repair.h"
#include "common/journal/recording_end.h"

namespace trocar::journal {
namespace {

template <typename Number>
bool parse_number(const StringMap& entries, const char* key, int base, Number& value) {
  const auto found = entries.find(key);
  if (found == entries.end()) return false;
  const char* end = found->second.data() + found->second.size();
  const auto [stopped, error] = std::from_chars(found->second.data(), end, value, base);
  return error == std::errc() && stopped == end;
}
bool parse_message_bytes(BytesView bytes, google::protobuf::Message& message) {
  return bytes.size() <= kMaxChunkBytes &&
         check_budget(*message.GetDescriptor(), bytes, build_budget(bytes.size())).ok() &&
         message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
}

}  // namespace

Result<std::unique_ptr<SessionJournal>> SessionJournal::open(const std::string& path) {
  auto mcap = McapReader::open(path);
  if (!mcap.ok()) return mcap.error();
  std::unique_ptr<SessionJournal> journal(new SessionJournal(std::move(*mcap)));
  if (Status read = journal->read_info(); !read.ok()) return read.error();
  return journal;
}

Status SessionJournal::read_info() {
  const auto& all = mcap_->metadata();
  const auto metadata = std::find_if(
      all.begin(), all.end(), [](const McapMetadata& m) { return m.name == kSessionMetadataName; });
  if (mcap_->header().profile != kJournalProfile || metadata == all.end())
    return Error{ErrorCode::BadFile, mcap_->path() + ": an MCAP file, but not of a Trocar session"};
  const StringMap& entries = metadata->entries;
  const auto text = [&entries](const char* key) {
    const auto found = entries.find(key);
    return found == entries.end() ? std::string() : printable(found->second);
  };
  if (!parse_number(entries, "start_utc_ns", 10, info_.start_utc_ns) ||
      !parse_number(entries, "sim_version", 10, info_.sim_version) ||
      !parse_number(entries, "organ_hash", 16, info_.organ_hash))
    return Error{ErrorCode::BadFile, mcap_->path() + ": metadata " + kSessionMetadataName +
                                         " lacks start_utc_ns, sim_version or organ_hash"};
  for (const auto& [name, from] :
       {std::pair{"continues", &info_.continues}, {"trimmed", &info_.trimmed}}) {
    const auto tick = std::string(name) + "_tick";
    if (!entries.contains(tick)) continue;
    from->emplace();
    if (!parse_number(entries, tick.c_str(), 10, (*from)->tick))
      return Error{ErrorCode::BadFile, mcap_->path() + ": metadata " + kSessionMetadataName +
                                           " has a " + tick + " that is no number"};
    (*from)->file = text((std::string(name) + "_file").c_str());
  }
  info_.has_external_loads = entries.contains("external_loads");
  info_.starts_from_snapshot = text("start") == "snapshot";
  info_.has_implicit_strain = text("averaged_strain") == "implicit";
  times_.start_utc_ns = info_.start_utc_ns;
  info_.protocol = text("protocol");
  info_.organ_name = text("organ_name");
  info_.last_tick = times_.tick(mcap_->statistics().end_time);
  const bool is_repaired = std::ranges::any_of(
      all, [](const McapMetadata& m) { return m.name == kRepairedMetadataName; });
  const auto end = check_counts(*mcap_);
  info_.is_finished = mcap_->is_finished() && !is_repaired && end.status != EndStatus::Wrong;
  info_.summary = mcap_->summary_text();
  if (end.status == EndStatus::Wrong) info_.summary += ", " + end.text;
  if (is_repaired) info_.summary += ", repaired: what the writer lost is missing";
  return read_participants();
}

// Damage here costs names, not the journal.
Status SessionJournal::read_participants() {
  const auto everything = std::numeric_limits<Tick>::max();
  std::set<std::pair<std::uint32_t, std::string>> known;
  const TickVisitor<proto::Participants> note = [&](Tick, const proto::Participants& list) {
    for (const proto::Participant& participant : list.participant()) {
      const auto name = printable(participant.name());
      if (!known.emplace(participant.slot(), name).second) continue;
      info_.participants.push_back(participant);
      info_.participants.back().set_name(name);
    }
    return true;
  };
  const TickVisitor<proto::JournalGap> count = [this](Tick, const proto::JournalGap& gap) {
    info_.gap_messages += gap.messages();
    if (gap.is_join() && info_.joins.size() < kMostParts) info_.joins.push_back(gap.last_tick());
    return true;
  };
  for (const Status& read : {read_topic(JournalTopic::Participants, 0, everything, note),
                             read_topic(JournalTopic::Gap, 0, everything, count)})
    if (!read.ok()) info_.summary += "; " + read.error().message;
  return {};
}

Error SessionJournal::not_a(JournalTopic topic, std::uint64_t log_time) const {
  return {ErrorCode::BadFile, mcap_->path() + ": message on " + topic_name(topic) + " at tick " +
                                  std::to_string(times_.tick(log_time)) +
                                  " is malformed; was it written by another program?"};
}

template <typename Message>
Status SessionJournal::read_topic(JournalTopic topic, Tick from, Tick to,
                                  const TickVisitor<Message>& visitor) {
  // Ticks beyond the last one could overflow the time.
  const Tick last_tick = std::min(to, info_.last_tick);
  if (from > last_tick) return {};
  Message message;
  Status failure;
  const ReadReport report = mcap_->read(
      [topic](const McapChannel& channel) { return channel.topic == topic_name(topic); },
      {times_.log_time(from), times_.log_time(last_tick)},
      [&](const McapMessage& m) {
        if (!parse_message_bytes(m.data, message)) {
          failure = not_a(topic, m.log_time);
          return false;
        }
        return visitor(times_.tick(m.log_time), message);
      });
  return failure.ok() ? report.status() : failure;
}

template <typename Message>
Result<std::optional<Message>> SessionJournal::last(JournalTopic topic, Tick tick) {
  auto found =
      mcap_->last_before(topic_name(topic), times_.log_time(std::min(tick, info_.last_tick)));
  if (!found.ok()) return found.error();
  if (!*found) return std::optional<Message>();
  Message message;
  if (!parse_message_bytes((*found)->data, message)) return not_a(topic, (*found)->log_time);
  return std::optional<Message>(std::move(message));
}

Result<proto::Organ> SessionJournal::organ() {
  auto organ = last<proto::Organ>(JournalTopic::Organ, 0);
  if (!organ.ok()) return organ.error();
  if (!*organ)
    return Error{ErrorCode::BadFile, mcap_->path() + ": no organ; the recording ended too early"};
  return std::move(**organ);
}

Result<std::optional<proto::ExternalLoads>> SessionJournal::loads() {
  return last<proto::ExternalLoads>(JournalTopic::Loads, 0);
}

Result<std::optional<proto::BleedingRules>> SessionJournal::bleeding() {
  return last<proto::BleedingRules>(JournalTopic::Bleeding, info_.begin_tick());
}

Result<std::optional<proto::ThreadRules>> SessionJournal::threads() {
  return last<proto::ThreadRules>(JournalTopic::Threads, info_.begin_tick());
}

Status SessionJournal::read_tick_records(Tick from, Tick to,
                                         const TickVisitor<proto::TickRecord>& visitor) {
  // A batch carries the tick of its frame, the last of its records.
  const Tick last_batch = to > info_.last_tick ? to : to + kTicksPerFrame;
  return read_topic<proto::TickBatch>(JournalTopic::TickBatch, from, last_batch,
                                      [&](Tick, const proto::TickBatch& batch) {
                                        for (const proto::TickRecord& record : batch.record()) {
                                          if (record.tick() < from || record.tick() > to) continue;
                                          if (!visitor(record.tick(), record)) return false;
                                        }
                                        return true;
                                      });
}

Status SessionJournal::read_surface_deltas(Tick from, Tick to,
                                           const TickVisitor<proto::SurfaceFrame>& visitor) {
  return read_topic(JournalTopic::SurfaceDelta, from, to, visitor);
}
Status SessionJournal::read_surface_keys(Tick from, Tick to,
                                         const TickVisitor<proto::SurfaceFrame>& visitor) {
  return read_topic(JournalTopic::SurfaceKey, from, to, visitor);
}
Status SessionJournal::read_topology_changes(Tick from, Tick to,
                                             const TickVisitor<proto::SurfaceChange>& visitor) {
  return read_topic(JournalTopic::TopologyChange, from, to, visitor);
}
Status SessionJournal::read_frame_states(Tick from, Tick to,
                                         const TickVisitor<proto::FrameState>& visitor) {
  return read_topic(JournalTopic::FrameState, from, to, visitor);
}
Status SessionJournal::read_participants(Tick from, Tick to,
                                         const TickVisitor<proto::Participants>& visitor) {
  return read_topic(JournalTopic::Participants, from, to, visitor);
}
Status SessionJournal::read_claims(Tick from, Tick to,
                                   const TickVisitor<proto::ClaimLog>& visitor) {
  return read_topic(JournalTopic::Claims, from, to, visitor);
}
Status SessionJournal::read_hands(Tick from, Tick to, const TickVisitor<proto::HandLog>& visitor) {
  return read_topic(JournalTopic::Hands, from, to, visitor);
}
Status SessionJournal::read_lessons(Tick from, Tick to,
                                    const TickVisitor<proto::LessonRecord>& visitor) {
  return read_topic(JournalTopic::Lesson, from, to, visitor);
}
Status SessionJournal::read_snapshots(Tick from, Tick to,
                                      const TickVisitor<proto::WorldSnapshot>& visitor) {
  return read_topic(JournalTopic::Snapshot, from, to, visitor);
}

ReadReport SessionJournal::read_all(const BytesVisitor& visitor) {
  return mcap_->read({}, {}, [&](const McapMessage& m) {
    return visitor(mcap_->channels().at(m.channel_id).topic, times_.tick(m.log_time), m.data);
  });
}

Result<std::optional<proto::WorldSnapshot>> SessionJournal::snapshot_before(Tick tick) {
  return last<proto::WorldSnapshot>(JournalTopic::Snapshot, tick);
}
Result<std::optional<proto::SurfaceFrame>> SessionJournal::surface_key_before(Tick tick) {
  return last<proto::SurfaceFrame>(JournalTopic::SurfaceKey, tick);
}
Result<std::optional<proto::SurfaceTopology>> SessionJournal::topology_before(Tick tick) {
  return last<proto::SurfaceTopology>(JournalTopic::Topology, tick);
}
Result<std::optional<proto::Participants>> SessionJournal::participants_before(Tick tick) {
  return last<proto::Participants>(JournalTopic::Participants, tick);
}
Result<std::optional<proto::FrameState>> SessionJournal::frame_state_before(Tick tick) {
  return last<proto::FrameState>(JournalTopic::FrameState, tick);
}

}  // namespace trocar::journal
