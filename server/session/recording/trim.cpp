#include "server/session/recording/trim.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include "common/base/checksum.h"
#include "common/base/version.h"
#include "common/journal/mcap_reader.h"
#include "common/journal/recording_end.h"
#include "common/wire/surface_messages.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/recording/recorded_session.h"
#include "server/session/recording/resume.h"
#include "server/session/recording/session_copy.h"
#include "server/session/recording/tick_records.h"
#include "server/session/replication/messages.h"

namespace trocar::recording {
namespace {

using journal::JournalTopic;

constexpr Tick kListSettled = 1000;  // see verify: lists of participants have no exact tick

// A cut is what is kept, and what that needs to begin with.
struct Cut {
  Tick begin = 0;            // after it
  Tick key = 0;              // of the first keyframe
  Tick end = 0;              // of the last frame
  bool is_at_start = false;  // of the recording: it begins as that does
};

Error refused_trim(const std::string& path, const std::string& why) {
  return {ErrorCode::BadFile, path + ": " + why};
}

Result<Cut> find_cut(journal::SessionJournal& journal, const std::string& path,
                     const TrimOptions& options) {
  const auto& info = journal.info();
  if (options.from >= options.to || options.from >= info.last_tick)
    return Error{ErrorCode::Usage,
                 fmt::format("{}: --from has to lie before --to and before its end, {:.3f} s", path,
                             static_cast<double>(info.last_tick) * 1e-3)};
  const auto end = journal.frame_state_before(options.to);
  if (!end) return end.error();
  const auto key = journal.surface_key_before(options.from);
  if (!key) return key.error();
  Cut cut;
  cut.key = *key ? (*key)->tick() : 0;
  cut.begin = cut.key > kTicksPerFrame ? cut.key - kTicksPerFrame : 0;
  cut.is_at_start = cut.begin <= info.begin_tick();
  if (cut.is_at_start) cut.begin = info.begin_tick();
  cut.end = *end ? (*end)->tick() : 0;
  if (cut.end <= std::max(cut.begin, cut.key))
    return Error{ErrorCode::Usage, path + ": has no frame between --from and --to"};
  return cut;
}

class Trimmer {
 public:
  Trimmer(journal::SessionJournal& journal, journal::McapReader& reader, const Cut& cut,
          SessionCopy& copy)
      : journal_(journal), reader_(reader), cut_(cut), copy_(copy) {
    times_.start_utc_ns = journal.info().start_utc_ns;
  }

  // Writes what the recording has said before, as it was; `session` is at cut.begin, or null.
  Status begin(ResumedSession* session) {
    auto organ = journal_.organ();
    if (!organ) return organ.error();
    if (auto s = write(JournalTopic::Organ, 0, *organ); !s) return s;
    auto rules = journal_.bleeding();
    if (!rules) return rules.error();
    if (*rules)
      if (auto s = write(JournalTopic::Bleeding, cut_.begin, **rules); !s) return s;
    auto threads = journal_.threads();
    if (!threads) return threads.error();
    if (*threads)
      if (auto s = write(JournalTopic::Threads, cut_.begin, **threads); !s) return s;
    if (auto s = write_topology(session); !s) return s;
    if (auto s = write_last(JournalTopic::Participants); !s) return s;
    if (auto s = write_last(JournalTopic::Drawing); !s) return s;
    if (auto s = write_lesson(); !s) return s;
    if (session == nullptr) return {};
    if (auto s = write_state(*session); !s) return s;
    return {};
  }

  Status copy_rest() {
    Status written;
    const auto read = reader_.read(
        {}, {cut_.is_at_start ? 0 : times_.log_time(cut_.begin) + 1, times_.log_time(cut_.end)},
        [&](const journal::McapMessage& message) {
          written = copy(message);
          return written.ok();
        });
    if (!written) return written;
    if (read.damaged_chunks > 0) return read.first_damage;
    return repeat_list();
  }

 private:
  Status write(JournalTopic topic, Tick tick, const google::protobuf::Message& message) {
    return copy_.write(topic, tick, times_.log_time(tick), message);
  }

  Status write_topology(ResumedSession* session) {
    if (session == nullptr) return write_last(JournalTopic::Topology);
    proto::SurfaceTopology topology;
    wire::write(session->simulation.layout(), session->simulation.organ().name, topology);
    return write(JournalTopic::Topology, cut_.begin, topology);
  }

  // Writes the last message of a topic up to the beginning.
  Status write_last(JournalTopic topic) {
    auto last = reader_.last_before(journal::topic_name(topic), times_.log_time(cut_.begin));
    if (!last) return last.error();
    if (!*last) return {};
    return copy_.write(journal::topic_name(topic), cut_.begin, (*last)->publish_time,
                       (*last)->data);
  }

  // Its text, and the stage that was told last.
  Status write_lesson() {
    std::optional<proto::LessonRecord> text, stage;
    const auto read =
        journal_.read_lessons(0, cut_.begin, [&](Tick, const proto::LessonRecord& record) {
          if (record.has_lesson()) text = record;
          if (record.has_stage()) stage = record;
          return true;
        });
    if (!read) return read;
    for (auto* record : {&text, &stage}) {
      if (!*record) continue;
      (*record)->clear_left_out();
      if (auto s = write(JournalTopic::Lesson, cut_.begin, **record); !s) return s;
    }
    return {};
  }

  Status write_state(ResumedSession& session) {
    Bytes state;
    session.simulation.write_snapshot(state);
    proto::WorldSnapshot snapshot;
    snapshot.set_tick(cut_.begin);
    snapshot.set_sim_version(kSimVersion);
    snapshot.set_organ_hash(journal_.info().organ_hash);
    snapshot.set_state_hash(xxh3_64(state));
    snapshot.set_state(state.data(), state.size());
    return write(JournalTopic::Snapshot, cut_.begin, snapshot);
  }

  Status copy(const journal::McapMessage& message) {
    const auto& topic = reader_.channels().at(message.channel_id).topic;
    const Tick tick = times_.tick(message.log_time);
    const auto known = journal::topic_of(topic);
    if (!cut_.is_at_start) {
      if (known == JournalTopic::TickBatch && !has_batch_) return copy_first_batch(message);
      // The keyframe stands for it.
      if (known == JournalTopic::SurfaceDelta && tick <= cut_.key) return {};
    }
    return copy_.write(topic, tick, message.publish_time, message.data);
  }

  // Decisions are written where they change: the first record has to have them.
  Status copy_first_batch(const journal::McapMessage& message) {
    has_batch_ = true;
    const Tick tick = times_.tick(message.log_time);
    proto::TickBatch batch;
    if (!batch.ParseFromArray(message.data.data(), static_cast<int>(message.data.size())) ||
        batch.record().empty())
      return Error{ErrorCode::BadFile,
                   fmt::format("the ticks of the frame at tick {} cannot be read", tick)};
    step::TickRecord first;
    const auto read = read_ticks(journal_, [&](const step::TickRecord& record, bool& stop) {
      first = record;
      stop = record.tick >= batch.record(0).tick();
      return Status();
    });
    if (!read) return read;
    proto::TickRecord decided;
    to_message(first, nullptr, decided);
    *batch.mutable_record(0)->mutable_decisions() = decided.decisions();
    return copy_.write(JournalTopic::TickBatch, tick, message.publish_time, batch);
  }

  // Who joins in the last second may be on a list that comes after it: a list that is said again
  // there tells readers so.
  Status repeat_list() {
    bool has_next = false;
    const auto read = journal_.read_participants(cut_.end + 1, cut_.end + kListSettled,
                                                 [&](Tick, const proto::Participants&) {
                                                   has_next = true;
                                                   return false;
                                                 });
    if (!read || !has_next) return read;
    auto list = journal_.participants_before(cut_.end);
    if (!list) return list.error();
    return write(JournalTopic::Participants, cut_.end, *list ? **list : proto::Participants());
  }

  journal::SessionJournal& journal_;
  journal::McapReader& reader_;
  const Cut cut_;
  SessionCopy& copy_;
  journal::JournalTimes times_;
  bool has_batch_ = false;
};

}  // namespace

Result<TrimReport> trim(const std::string& from_path, const std::string& to_path,
                        const TrimOptions& options) {
  auto journal = journal::SessionJournal::open(from_path);
  if (!journal) return journal.error();
  auto reader = journal::McapReader::open(from_path);
  if (!reader) return reader.error();
  auto info = (*journal)->info();
  if (info.has_external_loads || info.starts_from_snapshot)
    return refused_trim(from_path, "is of a scenario, which is run again for a shorter recording");
  if (auto right = journal::refuse_wrong_end(**reader); !right) return right.error();
  const auto cut = find_cut(**journal, from_path, options);
  if (!cut) return cut.error();
  TrimReport report{.from = cut->begin, .to = cut->end};
  report.has_state = cut->is_at_start || info.sim_version == kSimVersion;
  std::optional<ResumedSession> session;
  if (!cut->is_at_start) {
    const auto file = std::filesystem::path(from_path).filename().string();
    info.continues.reset();
    info.trimmed = journal::Continuation{file, cut->begin};
    if (report.has_state) {
      auto resumed = resume_session(from_path, {.until = cut->begin});
      if (!resumed) return resumed.error();
      session.emplace(std::move(*resumed));
    }
  }
  auto copy = SessionCopy::create(to_path, info);
  if (!copy) return copy.error();
  if (auto noted = (*copy)->copy_metadata(**reader, false); !noted) return noted.error();
  Trimmer trimmer(**journal, **reader, *cut, **copy);
  Status written;
  if (!cut->is_at_start) written = trimmer.begin(session ? &*session : nullptr);
  if (written) written = trimmer.copy_rest();
  // Other errors are of the file that is written.
  if (!written && written.error().code != ErrorCode::BadFile) return written.error();
  if (!written) return refused_trim(from_path, written.error().message);
  report.messages = (*copy)->messages();
  const journal::McapMetadata note{kTrimmedMetadataName,
                                   {{"file", std::filesystem::path(from_path).filename().string()},
                                    {"from_tick", std::to_string(cut->begin)},
                                    {"to_tick", std::to_string(cut->end)}}};
  if (auto finished = (*copy)->finish(note); !finished) return finished.error();
  return report;
}

}  // namespace trocar::recording
