#include "server/session/recording/session_copy.h"

#include <fmt/format.h>

#include <charconv>
#include <limits>
#include <utility>

#include "common/journal/mcap_repair.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/recording/read_back.h"

namespace trocar::recording {
namespace {

using journal::JournalTopic;

constexpr std::string_view kToolTopic = "/tool/";

// "1.20" of a file.
bool parse_protocol(const std::string& text, std::uint32_t& major, std::uint32_t& minor) {
  const char* end = text.data() + text.size();
  const auto first = std::from_chars(text.data(), end, major);
  if (first.ec != std::errc() || first.ptr == end || *first.ptr != '.') return false;
  const auto second = std::from_chars(first.ptr + 1, end, minor);
  return second.ec == std::errc() && second.ptr == end;
}

}  // namespace

Result<std::unique_ptr<SessionCopy>> SessionCopy::create(const std::string& to,
                                                         const journal::SessionInfo& session) {
  if (auto is_free = UnfinishedFile::refuse_existing(to); !is_free) return is_free.error();
  journal::SessionDescription description{.start_utc_ns = session.start_utc_ns,
                                          .sim_version = session.sim_version,
                                          .organ_name = session.organ_name,
                                          .organ_hash = session.organ_hash,
                                          .has_external_loads = session.has_external_loads,
                                          .starts_from_snapshot = session.starts_from_snapshot,
                                          .has_implicit_strain = session.has_implicit_strain,
                                          .continues = session.continues,
                                          .trimmed = session.trimmed};
  if (session.start_utc_ns == 0 ||
      !parse_protocol(session.protocol, description.protocol_major, description.protocol_minor))
    return Error{ErrorCode::BadFile,
                 to + ": the recording does not say when it began, or with which protocol"};
  const auto temporary = UnfinishedFile::name_for(to);
  auto writer = journal::SessionJournalWriter::create(temporary, description);
  if (!writer) return writer.error();
  return std::unique_ptr<SessionCopy>(new SessionCopy(to, temporary, std::move(*writer),
                                                      session.start_utc_ns, session.begin_tick()));
}

SessionCopy::SessionCopy(std::string to, std::string temporary,
                         std::unique_ptr<journal::SessionJournalWriter> writer,
                         std::uint64_t start_utc_ns, Tick begin)
    : to_(std::move(to)),
      file_(std::move(temporary)),
      writer_(std::move(writer)),
      overview_(begin),
      begin_(begin),
      last_tick_(begin),
      most_ticks_((std::numeric_limits<std::uint64_t>::max() - start_utc_ns) / kTickNanoseconds) {}

SessionCopy::~SessionCopy() = default;

Status SessionCopy::write_metadata(const journal::McapMetadata& metadata) {
  return writer_->write_metadata(metadata);
}

Status SessionCopy::copy_metadata(const journal::McapReader& reader, bool keeps_repair) {
  for (const auto& metadata : reader.metadata()) {
    if (metadata.name == journal::kSessionMetadataName || journal::is_of_end(metadata)) continue;
    if (metadata.name == journal::kRepairedMetadataName && !keeps_repair) continue;
    if (!noted_.emplace(metadata.name, metadata.entries).second) continue;
    if (auto written = writer_->write_metadata(metadata); !written) return written;
  }
  return {};
}

Status SessionCopy::write(std::string_view topic, Tick tick, std::uint64_t publish_time_ns,
                          BytesView bytes) {
  if (topic == journal::topic_name(JournalTopic::Overview)) return {};
  if (tick < written_tick_ || tick > most_ticks_)
    return Error{ErrorCode::BadFile,
                 fmt::format("{}: a message at tick {}, from {} to {} are possible there", topic,
                             tick, written_tick_, most_ticks_)};
  written_tick_ = tick;
  last_publish_time_ns_ = publish_time_ns;
  if (topic.starts_with(kToolTopic)) {
    proto::ToolState state;
    if (!state.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())) ||
        state.tool() >= kMaxTools)
      return Error{ErrorCode::BadFile, std::string(topic) + ": the message at tick " +
                                           std::to_string(tick) + " cannot be read"};
    ++messages_;
    return writer_->write_tool({static_cast<std::uint8_t>(state.tool())}, tick, publish_time_ns,
                               state);
  }
  const auto known = journal::topic_of(topic);
  if (!known)
    return Error{ErrorCode::BadFile, std::string(topic) +
                                         ": this release does not know that channel, use the one "
                                         "that recorded it"};
  ++messages_;
  // The organ is written at tick 0, wherever the recording begins.
  if (*known != JournalTopic::Organ) last_tick_ = tick;
  if (auto written = writer_->write(*known, tick, publish_time_ns, bytes); !written) return written;
  const auto full = overview_.take(*known, tick, bytes);
  return full ? write_overview(*full, publish_time_ns) : Status(full.error());
}

Status SessionCopy::write(JournalTopic topic, Tick tick, std::uint64_t publish_time_ns,
                          const google::protobuf::Message& message) {
  scratch_.resize(message.ByteSizeLong());
  message.SerializeWithCachedSizesToArray(scratch_.data());
  return write(journal::topic_name(topic), tick, publish_time_ns, scratch_);
}

Status SessionCopy::write_overview(const std::optional<proto::Overview>& overview,
                                   std::uint64_t publish_time_ns) {
  if (!overview) return {};
  return writer_->write_overview(written_tick_, publish_time_ns, *overview);
}

Status SessionCopy::finish(const journal::McapMetadata& note) {
  if (auto written = write_overview(overview_.rest(), last_publish_time_ns_); !written)
    return written;
  if (auto flushed = writer_->flush(); !flushed) return flushed;
  if (auto noted = writer_->write_metadata(note); !noted) return noted;
  if (auto closed = writer_->close(); !closed) return closed;
  if (auto read =
          read_back(file_.path(), {.messages = messages_, .begin = begin_, .end = last_tick_});
      !read)
    return read;
  return file_.rename_to_new(to_);
}

}  // namespace trocar::recording
