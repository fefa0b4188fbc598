#include "common/journal/session_journal_writer.h"

#include <cstdio>
#include <ctime>

#include "common/base/assert.h"
#include "common/journal/proto_schema.h"

namespace trocar::journal {
namespace {

std::string hex(std::uint64_t value) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(value));
  return text;
}
// For people; readers use start_utc_ns.
std::string utc_text(std::uint64_t utc_ns) {
  const auto seconds = static_cast<std::time_t>(utc_ns / 1'000'000'000u);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

}  // namespace

Result<std::unique_ptr<SessionJournalWriter>> SessionJournalWriter::create(
    const std::string& path, const SessionDescription& session, const McapWriterOptions& options) {
  TROCAR_ASSERT(session.start_utc_ns > 0);
  auto mcap =
      McapWriter::create(path, {kJournalProfile, std::string("trocar ") + kVersion}, options);
  if (!mcap.ok()) return mcap.error();
  McapMetadata metadata{kSessionMetadataName, {}};
  metadata.entries["start_utc"] = utc_text(session.start_utc_ns);
  metadata.entries["start_utc_ns"] = std::to_string(session.start_utc_ns);
  metadata.entries["sim_version"] = std::to_string(session.sim_version);
  metadata.entries["protocol"] =
      std::to_string(session.protocol_major) + "." + std::to_string(session.protocol_minor);
  metadata.entries["organ_name"] = session.organ_name;
  metadata.entries["organ_hash"] = hex(session.organ_hash);
  if (session.continues) {
    metadata.entries["continues_file"] = session.continues->file;
    metadata.entries["continues_tick"] = std::to_string(session.continues->tick);
  }
  if (session.trimmed) {
    metadata.entries["trimmed_file"] = session.trimmed->file;
    metadata.entries["trimmed_tick"] = std::to_string(session.trimmed->tick);
  }
  if (session.has_external_loads) metadata.entries["external_loads"] = "in /loads";
  if (session.starts_from_snapshot) metadata.entries["start"] = "snapshot";
  if (session.has_implicit_strain) metadata.entries["averaged_strain"] = "implicit";
  metadata.entries[kPromisedEnd] = kEndMetadataName;
  std::unique_ptr<SessionJournalWriter> writer(
      new SessionJournalWriter(std::move(*mcap), JournalTimes{session.start_utc_ns}));
  if (Status written = writer->write_metadata(metadata); !written.ok()) return written.error();
  return writer;
}

SessionJournalWriter::SessionJournalWriter(std::unique_ptr<McapWriter> mcap, JournalTimes times)
    : mcap_(std::move(mcap)), times_(times) {
  for (int i = 0; i < kJournalTopicCount; ++i) {
    const auto topic = static_cast<JournalTopic>(i);
    channel_ids_[static_cast<std::size_t>(i)] =
        mcap_->add_channel(topic_name(topic), kProtobufEncoding, schema_of(topic_message(topic)));
  }
}

std::uint16_t SessionJournalWriter::schema_of(const google::protobuf::Descriptor& message) {
  const std::string name = schema_name(message);
  if (const auto known = schema_ids_.find(name); known != schema_ids_.end()) return known->second;
  return schema_ids_[name] = mcap_->add_schema(name, kProtobufEncoding, schema_bytes(message));
}

Status SessionJournalWriter::write(JournalTopic topic, Tick tick, std::uint64_t publish_time_ns,
                                   BytesView message) {
  return append(channel_ids_[static_cast<std::size_t>(topic)], topic_name(topic), tick,
                publish_time_ns, message);
}

Status SessionJournalWriter::append(std::uint16_t channel, std::string_view topic, Tick tick,
                                    std::uint64_t publish_time_ns, BytesView message) {
  const auto log_time = times_.log_time(tick);
  if (Status written = mcap_->write(channel, log_time, publish_time_ns, message); !written.ok())
    return written;
  sum_.add(topic, log_time, publish_time_ns, message);
  return {};
}

Status SessionJournalWriter::write_metadata(const McapMetadata& metadata) {
  sum_.add(metadata);
  return mcap_->write_metadata(metadata);
}

Status SessionJournalWriter::close(const secure::SigningKey* key) {
  if (Status flushed = flush(); !flushed.ok()) return flushed;
  const auto end = sum_.end();
  if (Status written = write_metadata(end); !written.ok()) return written;
  if (key != nullptr)
    if (Status written = write_metadata(sign(end, *key)); !written.ok()) return written;
  return mcap_->close();
}

Status SessionJournalWriter::write(JournalTopic topic, Tick tick, std::uint64_t publish_time_ns,
                                   const google::protobuf::Message& message) {
  TROCAR_ASSERT(message.GetDescriptor() == &topic_message(topic));
  scratch_.resize(message.ByteSizeLong());
  message.SerializeWithCachedSizesToArray(scratch_.data());
  return write(topic, tick, publish_time_ns, scratch_);
}

Status SessionJournalWriter::write_overview(Tick tick, std::uint64_t now_ns,
                                            const proto::Overview& overview) {
  if (Status flushed = flush(); !flushed.ok()) return flushed;
  if (Status written = write(JournalTopic::Overview, tick, now_ns, overview); !written.ok())
    return written;
  return flush();
}

Status SessionJournalWriter::write_tool(ToolSlot tool, Tick tick, std::uint64_t publish_time_ns,
                                        const proto::ToolState& state) {
  TROCAR_ASSERT(tool.is_valid());
  const auto topic = "/tool/" + std::to_string(tool.value);
  std::uint16_t& channel = tool_channel_ids_[tool.value];
  if (channel == 0)
    channel =
        mcap_->add_channel(topic, kProtobufEncoding, schema_of(*proto::ToolState::descriptor()));
  scratch_.resize(state.ByteSizeLong());
  state.SerializeWithCachedSizesToArray(scratch_.data());
  return append(channel, topic, tick, publish_time_ns, scratch_);
}

}  // namespace trocar::journal
