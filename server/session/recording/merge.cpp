#include "server/session/recording/merge.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>

#include "common/journal/mcap_reader.h"
#include "common/journal/mcap_repair.h"
#include "common/journal/recording_end.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/recording/session_copy.h"
#include "server/session/recording/session_parts.h"

namespace trocar::recording {
namespace {

namespace fs = std::filesystem;
using journal::JournalTopic;

// A Drawing without strokes, which replaces what was.
constexpr std::array<std::uint8_t, 2> kNothingDrawn{0x10, 0};

std::string name_of_file(const std::string& path) {
  return fs::path(path).filename().string();
}

Error refused_part(const std::string& path, const std::string& why) {
  return {ErrorCode::BadFile, path + ": " + why};
}

// The part that no other one goes on with: the one that begins last.
Result<std::string> last_part(const std::vector<std::string>& paths) {
  std::string last;
  Tick begin = 0;
  for (const auto& path : paths) {
    auto journal = journal::SessionJournal::open(path);
    if (!journal) return journal.error();
    if (!last.empty() && (*journal)->info().begin_tick() < begin) continue;
    last = path;
    begin = (*journal)->info().begin_tick();
  }
  return last;
}

bool is_same_file(const std::string& a, const std::string& b) {
  std::error_code ignored;
  return fs::equivalent(a, b, ignored);
}

bool contains(const SessionParts& session, const std::string& path) {
  return std::ranges::any_of(session.parts,
                             [&](const auto& part) { return is_same_file(part.path, path); });
}

// Why a part that was given is none of that session.
Error stranger(const SessionParts& session, const std::string& path) {
  auto journal = journal::SessionJournal::open(path);
  if (!journal) return journal.error();
  const auto& first = session.parts.front();
  const auto why = mismatch((*journal)->info(), first.journal->info());
  return refused_part(path, "is no part of this session: " + name_of_file(first.path) + " " +
                                (why.empty() ? "goes on with a file of another name or folder, " +
                                                   first.journal->info().continues->file
                                             : why));
}

Status check_parts(const SessionParts& session, const std::vector<std::string>& given) {
  for (const auto& path : given)
    if (!contains(session, path)) return stranger(session, path);
  for (const auto& part : session.parts) {
    const bool is_given =
        std::ranges::any_of(given, [&](const auto& path) { return is_same_file(part.path, path); });
    if (!is_given) return refused_part(part.path, "is a part of this session, too: name it");
  }
  const auto& first = session.parts.front();
  if (!session.missing.empty()) return refused_part(first.path, session.missing);
  if (session.parts.size() < 2)
    return Error{ErrorCode::Usage,
                 first.path + ": is all of its session, there is nothing to merge"};
  for (const auto& part : session.parts) {
    const auto &info = part.journal->info(), &begin = first.journal->info();
    if (info.sim_version != begin.sim_version || info.protocol != begin.protocol)
      return refused_part(part.path,
                          fmt::format("was recorded by another release (sim_version {}, "
                                      "protocol {}) than {} (sim_version {}, protocol {})",
                                      info.sim_version, info.protocol, name_of_file(first.path),
                                      begin.sim_version, begin.protocol));
    if (info.has_external_loads)
      return refused_part(part.path, "is of a scenario, of which there are no parts");
  }
  return {};
}

class Merger {
 public:
  Merger(const SessionParts& session, SessionCopy& copy, MergeReport& report)
      : session_(session), copy_(copy), report_(report) {}

  Status run() {
    for (std::size_t i = 0; i < session_.parts.size(); ++i)
      if (auto copied = copy_part(i); !copied) return copied;
    return {};
  }

 private:
  Status copy_part(std::size_t number) {
    const auto& part = session_.parts[number];
    auto reader = journal::McapReader::open(part.path);
    if (!reader) return reader.error();
    if (auto right = journal::refuse_wrong_end(**reader); !right) return right;
    const bool is_last = number + 1 == session_.parts.size();
    // The lost end of an earlier part does not count.
    if (auto noted = copy_.copy_metadata(**reader, is_last); !noted) return noted;
    const auto& info = part.journal->info();
    if (number > 0)
      if (auto joined = join(*part.journal); !joined) return joined;
    const journal::JournalTimes times{info.start_utc_ns};
    const Tick until = std::min(part.until, info.last_tick);
    Tick state_tick = 0;
    Status written;
    const auto read =
        (*reader)->read({}, {0, times.log_time(until)}, [&](const journal::McapMessage& message) {
          const auto& topic = (*reader)->channels().at(message.channel_id).topic;
          const auto known = journal::topic_of(topic);
          if (known == JournalTopic::FrameState) state_tick = times.tick(message.log_time);
          if (number > 0 && (known == JournalTopic::Organ || known == JournalTopic::Bleeding ||
                             known == JournalTopic::Threads))
            return true;  // the first part has them
          has_drawn_ |= known == JournalTopic::Drawing;
          written =
              copy_.write(topic, times.tick(message.log_time), message.publish_time, message.data);
          publish_time_ns_ = message.publish_time;
          return written.ok();
        });
    // Others are of the file that is written.
    if (!written && written.error().code != ErrorCode::BadFile) return written;
    if (!written) return refused_part(part.path, written.error().message);
    if (read.damaged_chunks > 0) return refused_part(part.path, read.first_damage.message);
    if (!is_last && state_tick != until) ++report_.torn_frames;
    report_.parts.push_back(part.path);
    return {};
  }

  Status join(journal::SessionJournal& next) {
    const Tick tick = next.info().begin_tick();
    report_.joins.push_back(tick);
    proto::JournalGap mark;
    mark.set_first_tick(tick + 1);
    mark.set_last_tick(tick);
    mark.set_is_join(true);
    if (auto written = copy_.write(JournalTopic::Gap, tick, publish_time_ns_, mark); !written)
      return written;
    // Who was there is there no more, unless the next server says so at once.
    const auto list = next.participants_before(tick);
    if (!list) return list.error();
    if (!*list)
      if (auto written = copy_.write(JournalTopic::Participants, tick, publish_time_ns_,
                                     proto::Participants());
          !written)
        return written;
    // A server that goes on has no drawings of the one before.
    if (!has_drawn_) return {};
    return copy_.write(journal::topic_name(JournalTopic::Drawing), tick, publish_time_ns_,
                       kNothingDrawn);
  }

  const SessionParts& session_;
  SessionCopy& copy_;
  MergeReport& report_;
  std::uint64_t publish_time_ns_ = 0;
  bool has_drawn_ = false;
};

std::string names_of(const std::vector<std::string>& paths) {
  std::string names;
  for (const auto& path : paths) names += (names.empty() ? "" : ", ") + name_of_file(path);
  return names;
}

}  // namespace

Result<MergeReport> merge(const std::vector<std::string>& parts, const std::string& to) {
  const auto last = last_part(parts);
  if (!last) return last.error();
  const auto session = open_session_parts(*last);
  if (!session) return session.error();
  if (auto checked = check_parts(*session, parts); !checked) return checked.error();
  auto copy = SessionCopy::create(to, session->parts.front().journal->info());
  if (!copy) return copy.error();
  MergeReport report;
  if (auto merged = Merger(*session, **copy, report).run(); !merged) return merged.error();
  report.messages = (*copy)->messages();
  report.last_tick = (*copy)->last_tick();
  const auto& end = session->parts.back().journal;
  report.has_end = end->info().is_finished;
  // The end that the last server could not write is missing, whatever index the new file has.
  if (!end->container().is_finished())
    if (auto noted = (*copy)->write_metadata(
            {journal::kRepairedMetadataName,
             {{"file", name_of_file(session->parts.back().path)},
              {"dropped_bytes", std::to_string(end->container().dropped_bytes())},
              {"damaged_chunks", "0"}}});
        !noted)
      return noted.error();
  const journal::McapMetadata note{kMergedMetadataName,
                                   {{"parts", names_of(report.parts)},
                                    {"joins", fmt::format("{}", fmt::join(report.joins, ", "))}}};
  if (auto finished = (*copy)->finish(note); !finished) return finished.error();
  return report;
}

}  // namespace trocar::recording
