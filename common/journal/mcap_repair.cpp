#include "common/journal/mcap_repair.h"

#include <algorithm>
#include <filesystem>

#include "common/journal/mcap_reader.h"
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

Status copy(McapReader& reader, McapWriter& writer, RepairReport& report) {
  const auto channels = add_channels(reader, writer);
  Status written;
  const auto copied =
      reader.read([&](const McapChannel& channel) { return channels.contains(channel.id); }, {},
                  [&](const McapMessage& message) {
                    written = writer.write(channels.at(message.channel_id), message.log_time,
                                           message.publish_time, message.data);
                    report.messages += written.ok();
                    return written.ok();
                  });
  report.damaged_chunks = copied.damaged_chunks;
  return written;
}

}  // namespace

Result<RepairReport> repair(const std::string& from, const std::string& to) {
  auto opened = McapReader::open(from);
  if (!opened) return opened.error();
  auto& reader = **opened;
  RepairReport report{.dropped_bytes = reader.dropped_bytes()};
  const bool is_whole = reader.is_finished() &&
                        reader.read({}, {}, [](const McapMessage&) { return true; }).status().ok();
  if (is_whole) return Error{ErrorCode::Usage, from + ": is whole, there is nothing to repair"};
  auto created = McapWriter::create(to, reader.header());
  if (!created) return created.error();
  auto& writer = **created;
  const auto give_up = [&](const Error& error) {
    std::error_code ignored;
    std::filesystem::remove(to, ignored);
    return error;
  };
  for (const auto& metadata : reader.metadata())
    if (const auto written = writer.write_metadata(metadata); !written)
      return give_up(written.error());
  if (const auto copied = copy(reader, writer, report); !copied) return give_up(copied.error());
  const McapMetadata note{kRepairedMetadataName,
                          {{"file", std::filesystem::path(from).filename().string()},
                           {"dropped_bytes", std::to_string(report.dropped_bytes)},
                           {"damaged_chunks", std::to_string(report.damaged_chunks)}}};
  if (const auto written = writer.flush(); !written) return give_up(written.error());
  if (const auto written = writer.write_metadata(note); !written) return give_up(written.error());
  if (const auto closed = writer.close(); !closed) return give_up(closed.error());
  return report;
}

}  // namespace trocar::journal
