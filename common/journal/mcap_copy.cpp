#include "common/journal/mcap_copy.h"

#include "common/base/unfinished_file.h"
#include "common/journal/mcap_writer.h"
#include "common/journal/recording_end.h"
#include "common/journal/session_topics.h"

namespace trocar::journal {
namespace {

// Ids of the new file's channels by those of the old one.
std::map<std::uint16_t, std::uint16_t> add_channels(const McapReader& reader, McapWriter& writer) {
  std::map<std::uint16_t, std::uint16_t> schemas{{0, 0}}, channels;
  for (const auto& [id, schema] : reader.schemas())
    schemas[id] = writer.add_schema(schema.name, schema.encoding, schema.data);
  for (const auto& [id, channel] : reader.channels())
    if (const auto schema = schemas.find(channel.schema_id); schema != schemas.end())
      channels[id] = writer.add_channel(channel.topic, channel.message_encoding, schema->second,
                                        channel.metadata);
  return channels;
}

Status copy(McapReader& reader, McapWriter& writer, const CopyOptions& options,
            ReadReport& report) {
  const bool is_session = reader.header().profile == kJournalProfile;
  ContentSum sum;
  const auto write_metadata = [&](const McapMetadata& metadata) {
    sum.add(metadata);
    return writer.write_metadata(metadata);
  };
  for (const auto& metadata : reader.metadata()) {
    if (is_of_end(metadata)) continue;
    auto changed = options.change_metadata(metadata);
    if (is_session && changed.name == kSessionMetadataName)
      changed.entries[kPromisedEnd] = kEndMetadataName;
    if (auto written = write_metadata(changed); !written) return written;
  }
  const auto channels = add_channels(reader, writer);
  Status written;
  const auto copy_message = [&](const McapMessage& message) -> Status {
    const auto& channel = reader.channels().at(message.channel_id);
    const auto bytes =
        options.change ? options.change(channel, message) : Result<BytesView>(message.data);
    if (!bytes) return bytes.error();
    sum.add(channel.topic, message.log_time, message.publish_time, *bytes);
    return writer.write(channels.at(message.channel_id), message.log_time, message.publish_time,
                        *bytes);
  };
  report =
      reader.read([&](const McapChannel& channel) { return channels.contains(channel.id); }, {},
                  [&](const McapMessage& message) {
                    written = copy_message(message);
                    return written.ok();
                  });
  if (!written) return written;
  if (auto flushed = writer.flush(); !flushed) return flushed;
  if (options.note)
    if (auto noted = write_metadata(*options.note); !noted) return noted;
  if (is_session) {
    const auto end = sum.end();
    if (auto ended = write_metadata(end); !ended) return ended;
    if (options.key != nullptr)
      if (auto noted = write_metadata(sign(end, *options.key)); !noted) return noted;
  }
  return writer.close();
}

}  // namespace

Result<ReadReport> copy_recording(McapReader& reader, const std::string& to,
                                  const CopyOptions& options) {
  if (auto is_free = UnfinishedFile::refuse_existing(to); !is_free) return is_free.error();
  const auto part = UnfinishedFile::name_for(to);
  auto created = McapWriter::create(part, reader.header());
  if (!created) return created.error();
  UnfinishedFile file(part);
  ReadReport report;
  if (auto copied = copy(reader, **created, options, report); !copied) return copied.error();
  if (auto named = file.rename_to_new(to); !named) return named.error();
  return report;
}

}  // namespace trocar::journal
