#include "common/journal/mcap_copy.h"

#include "common/base/unfinished_file.h"
#include "common/journal/mcap_writer.h"

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

Status copy(McapReader& reader, McapWriter& writer, const MessageChange& change,
            const McapMetadata& note, const MetadataChange& change_metadata, ReadReport& report) {
  for (const auto& metadata : reader.metadata())
    if (auto written = writer.write_metadata(change_metadata(metadata)); !written) return written;
  const auto channels = add_channels(reader, writer);
  Status written;
  report =
      reader.read([&](const McapChannel& channel) { return channels.contains(channel.id); }, {},
                  [&](const McapMessage& message) {
                    const auto bytes = change(reader.channels().at(message.channel_id), message);
                    written = bytes ? writer.write(channels.at(message.channel_id),
                                                   message.log_time, message.publish_time, *bytes)
                                    : Status(bytes.error());
                    return written.ok();
                  });
  if (!written) return written;
  if (auto flushed = writer.flush(); !flushed) return flushed;
  if (auto noted = writer.write_metadata(note); !noted) return noted;
  return writer.close();
}

}  // namespace

Result<ReadReport> copy_recording(McapReader& reader, const std::string& to,
                                  const MessageChange& change, const McapMetadata& note,
                                  const MetadataChange& change_metadata) {
  if (auto is_free = UnfinishedFile::refuse_existing(to); !is_free) return is_free.error();
  const auto part = UnfinishedFile::name_for(to);
  auto created = McapWriter::create(part, reader.header());
  if (!created) return created.error();
  UnfinishedFile file(part);
  ReadReport report;
  if (auto copied = copy(reader, **created, change, note, change_metadata, report); !copied)
    return copied.error();
  if (auto named = file.rename_to_new(to); !named) return named.error();
  return report;
}

}  // namespace trocar::journal
