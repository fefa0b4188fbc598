#pragma once

// Writes a recording out of the messages of others: as a session's recorder would have written it,
// with its ticks, and with overviews made anew. The file gets its name when it is whole, and has
// been read back. One thread.

#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "common/base/result.h"
#include "common/base/unfinished_file.h"
#include "common/journal/mcap_reader.h"
#include "common/journal/session_journal.h"
#include "common/journal/session_journal_writer.h"
#include "server/session/recording/recorded_overview.h"

namespace trocar::recording {

class SessionCopy {
 public:
  // `to` must not exist. session: as SessionJournal read it from what is copied.
  static Result<std::unique_ptr<SessionCopy>> create(const std::string& to,
                                                     const journal::SessionInfo& session);
  ~SessionCopy();  // removes what was not finished
  SessionCopy(const SessionCopy&) = delete;
  SessionCopy& operator=(const SessionCopy&) = delete;

  Status write_metadata(const journal::McapMetadata& metadata);
  // Copies what a recording says besides its session, once. keeps_repair: also that it was
  // repaired.
  Status copy_metadata(const journal::McapReader& reader, bool keeps_repair);
  // Overviews are left out: they are made anew. Error: the tick is before that of the message
  // before, this program does not know the topic, or the message is none of it.
  Status write(std::string_view topic, Tick tick, std::uint64_t publish_time_ns, BytesView bytes);
  Status write(journal::JournalTopic topic, Tick tick, std::uint64_t publish_time_ns,
               const google::protobuf::Message& message);
  // Writes summary and `note`, reads all of it again (see read_back), and gives it its name.
  Status finish(const journal::McapMetadata& note);

  std::uint64_t messages() const { return messages_; }  // of those copied
  Tick last_tick() const { return last_tick_; }

 private:
  SessionCopy(std::string to, std::string temporary,
              std::unique_ptr<journal::SessionJournalWriter> writer, std::uint64_t start_utc_ns,
              Tick begin);
  Status write_overview(const std::optional<proto::Overview>& overview,
                        std::uint64_t publish_time_ns);

  std::string to_;
  UnfinishedFile file_;
  std::unique_ptr<journal::SessionJournalWriter> writer_;
  RecordedOverview overview_;
  std::set<std::pair<std::string, journal::StringMap>> noted_;
  Bytes scratch_;
  Tick begin_ = 0, last_tick_ = 0;
  Tick written_tick_ = 0;      // of the last message, whatever its topic
  const Tick most_ticks_ = 0;  // whose times a recording can hold
  std::uint64_t messages_ = 0, last_publish_time_ns_ = 0;
};

}  // namespace trocar::recording
