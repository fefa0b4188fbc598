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
  if (session.reduction) {
    metadata.entries["reduction_hash"] = hex(session.reduction->hash);
    metadata.entries["reduction_file"] = session.reduction->file;
    metadata.entries["reduction_source"] = session.reduction->source;
  }
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
  if (Status written = (*mcap)->write_metadata(metadata); !written.ok()) return written.error();
  return std::unique_ptr<SessionJournalWriter>(
      new SessionJournalWriter(std::move(*mcap), JournalTimes{session.start_utc_ns}));
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
  return mcap_->write(channel_ids_[static_cast<std::size_t>(topic)], times_.log_time(tick),
                      publish_time_ns, message);
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
  std::uint16_t& channel = tool_channel_ids_[tool.value];
  if (channel == 0)
    channel = mcap_->add_channel("/tool/" + std::to_string(tool.value), kProtobufEncoding,
                                 schema_of(*proto::ToolState::descriptor()));
  scratch_.resize(state.ByteSizeLong());
  state.SerializeWithCachedSizesToArray(scratch_.data());
  return mcap_->write(channel, times_.log_time(tick), publish_time_ns, scratch_);
}

}  // namespace trocar::journal
