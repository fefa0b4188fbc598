#include "common/journal/mcap_records.h"

namespace trocar::journal {
namespace {

// Puts a u32 byte length before what `put_entries` appends.
template <typename PutEntries>
void put_sized(Bytes& out, PutEntries put_entries) {
  const std::size_t at = out.size();
  ByteWriter(out).put(std::uint32_t{0});
  put_entries();
  const auto length = static_cast<std::uint32_t>(out.size() - at - 4);
  std::memcpy(out.data() + at, &length, sizeof length);
}
void put_string_map(Bytes& out, const StringMap& map) {
  put_sized(out, [&] {
    ByteWriter writer(out);
    for (const auto& [key, value] : map) {
      writer.put_string(key);
      writer.put_string(value);
    }
  });
}
void put_number_map(Bytes& out, const std::map<std::uint16_t, std::uint64_t>& map) {
  put_sized(out, [&] {
    ByteWriter writer(out);
    for (const auto& [key, value] : map) {
      writer.put(key);
      writer.put(value);
    }
  });
}

std::string take_text(ByteReader& reader) {
  return std::string(reader.read_string());
}
Bytes take_owned(ByteReader& reader, std::uint64_t length) {
  const BytesView view = reader.read_bytes(length);
  return {view.begin(), view.end()};
}
bool take_string_map(ByteReader& reader, StringMap& map) {
  ByteReader entries(reader.read_bytes(reader.read<std::uint32_t>()));
  while (entries.ok() && entries.remaining() > 0) {
    std::string key = take_text(entries);
    map.insert_or_assign(std::move(key), take_text(entries));
  }
  return entries.ok() && reader.ok();
}
bool take_number_map(ByteReader& reader, std::map<std::uint16_t, std::uint64_t>& map) {
  ByteReader entries(reader.read_bytes(reader.read<std::uint32_t>()));
  while (entries.ok() && entries.remaining() > 0) {
    const auto key = entries.read<std::uint16_t>();
    map.insert_or_assign(key, entries.read<std::uint64_t>());
  }
  return entries.ok() && reader.ok();
}
template <typename T>
std::optional<T> parsed(const ByteReader& reader, T value) {
  return reader.ok() ? std::optional<T>(std::move(value)) : std::nullopt;
}

}  // namespace

RecordScope::RecordScope(Bytes& out, Opcode opcode) : out_(out) {
  ByteWriter writer(out_);
  writer.put(opcode);
  writer.put(std::uint64_t{0});
  content_at_ = out_.size();
}
RecordScope::~RecordScope() {
  const std::uint64_t length = out_.size() - content_at_;
  std::memcpy(out_.data() + content_at_ - sizeof length, &length, sizeof length);
}

void put_header(Bytes& out, const McapHeader& header) {
  const RecordScope record(out, Opcode::Header);
  ByteWriter writer(out);
  writer.put_string(header.profile);
  writer.put_string(header.library);
}
void put_schema(Bytes& out, const McapSchema& schema) {
  const RecordScope record(out, Opcode::Schema);
  ByteWriter writer(out);
  writer.put(schema.id);
  writer.put_string(schema.name);
  writer.put_string(schema.encoding);
  writer.put(static_cast<std::uint32_t>(schema.data.size()));
  writer.put_bytes(schema.data);
}
void put_channel(Bytes& out, const McapChannel& channel) {
  const RecordScope record(out, Opcode::Channel);
  ByteWriter writer(out);
  writer.put(channel.id);
  writer.put(channel.schema_id);
  writer.put_string(channel.topic);
  writer.put_string(channel.message_encoding);
  put_string_map(out, channel.metadata);
}
void put_message(Bytes& out, const McapMessage& message) {
  const RecordScope record(out, Opcode::Message);
  ByteWriter writer(out);
  writer.put(message.channel_id);
  writer.put(message.sequence);
  writer.put(message.log_time);
  writer.put(message.publish_time);
  writer.put_bytes(message.data);
}
void put_chunk(Bytes& out, const McapChunk& chunk) {
  const RecordScope record(out, Opcode::Chunk);
  ByteWriter writer(out);
  writer.put(chunk.start_time);
  writer.put(chunk.end_time);
  writer.put(chunk.uncompressed_size);
  writer.put(chunk.uncompressed_crc);
  writer.put_string(chunk.compression);
  writer.put(std::uint64_t{chunk.records.size()});
  writer.put_bytes(chunk.records);
}
void put_message_index(Bytes& out, std::uint16_t channel_id,
                       const std::vector<MessageTimeAndOffset>& entries) {
  const RecordScope record(out, Opcode::MessageIndex);
  ByteWriter(out).put(channel_id);
  put_sized(out, [&] {
    ByteWriter writer(out);
    for (const MessageTimeAndOffset& entry : entries) {
      writer.put(entry.log_time);
      writer.put(entry.offset);
    }
  });
}
void put_chunk_index(Bytes& out, const McapChunkIndex& index) {
  const RecordScope record(out, Opcode::ChunkIndex);
  ByteWriter writer(out);
  writer.put(index.start_time);
  writer.put(index.end_time);
  writer.put(index.chunk_offset);
  writer.put(index.chunk_length);
  put_number_map(out, index.message_index_offsets);
  writer.put(index.message_index_length);
  writer.put_string(index.compression);
  writer.put(index.compressed_size);
  writer.put(index.uncompressed_size);
}
void put_statistics(Bytes& out, const McapStatistics& statistics) {
  const RecordScope record(out, Opcode::Statistics);
  ByteWriter writer(out);
  writer.put(statistics.message_count);
  writer.put(statistics.schema_count);
  writer.put(statistics.channel_count);
  writer.put(statistics.attachment_count);
  writer.put(statistics.metadata_count);
  writer.put(statistics.chunk_count);
  writer.put(statistics.start_time);
  writer.put(statistics.end_time);
  put_number_map(out, statistics.channel_message_counts);
}
void put_metadata(Bytes& out, const McapMetadata& metadata) {
  const RecordScope record(out, Opcode::Metadata);
  ByteWriter(out).put_string(metadata.name);
  put_string_map(out, metadata.entries);
}
void put_metadata_index(Bytes& out, const McapMetadataIndex& index) {
  const RecordScope record(out, Opcode::MetadataIndex);
  ByteWriter writer(out);
  writer.put(index.offset);
  writer.put(index.length);
  writer.put_string(index.name);
}
void put_summary_offset(Bytes& out, Opcode group, std::uint64_t start, std::uint64_t length) {
  const RecordScope record(out, Opcode::SummaryOffset);
  ByteWriter writer(out);
  writer.put(group);
  writer.put(start);
  writer.put(length);
}
void put_data_end(Bytes& out, std::uint32_t data_section_crc) {
  const RecordScope record(out, Opcode::DataEnd);
  ByteWriter(out).put(data_section_crc);
}

std::optional<McapHeader> parse_header(BytesView content) {
  ByteReader reader(content);
  McapHeader header;
  header.profile = take_text(reader);
  header.library = take_text(reader);
  return parsed(reader, std::move(header));
}
std::optional<McapSchema> parse_schema(BytesView content) {
  ByteReader reader(content);
  McapSchema schema;
  schema.id = reader.read<std::uint16_t>();
  schema.name = take_text(reader);
  schema.encoding = take_text(reader);
  schema.data = take_owned(reader, reader.read<std::uint32_t>());
  if (schema.id == 0) return std::nullopt;
  return parsed(reader, std::move(schema));
}
std::optional<McapChannel> parse_channel(BytesView content) {
  ByteReader reader(content);
  McapChannel channel;
  channel.id = reader.read<std::uint16_t>();
  channel.schema_id = reader.read<std::uint16_t>();
  channel.topic = take_text(reader);
  channel.message_encoding = take_text(reader);
  if (!take_string_map(reader, channel.metadata)) return std::nullopt;
  return parsed(reader, std::move(channel));
}
std::optional<McapMessage> parse_message(BytesView content) {
  ByteReader reader(content);
  McapMessage message;
  message.channel_id = reader.read<std::uint16_t>();
  message.sequence = reader.read<std::uint32_t>();
  message.log_time = reader.read<std::uint64_t>();
  message.publish_time = reader.read<std::uint64_t>();
  message.data = reader.read_bytes(reader.remaining());
  return parsed(reader, message);
}
std::optional<McapChunk> parse_chunk(BytesView content) {
  ByteReader reader(content);
  McapChunk chunk;
  chunk.start_time = reader.read<std::uint64_t>();
  chunk.end_time = reader.read<std::uint64_t>();
  chunk.uncompressed_size = reader.read<std::uint64_t>();
  chunk.uncompressed_crc = reader.read<std::uint32_t>();
  chunk.compression = reader.read_string();
  chunk.records = reader.read_bytes(reader.read<std::uint64_t>());
  return parsed(reader, chunk);
}
std::optional<McapChunkIndex> parse_chunk_index(BytesView content) {
  ByteReader reader(content);
  McapChunkIndex index;
  index.start_time = reader.read<std::uint64_t>();
  index.end_time = reader.read<std::uint64_t>();
  index.chunk_offset = reader.read<std::uint64_t>();
  index.chunk_length = reader.read<std::uint64_t>();
  if (!take_number_map(reader, index.message_index_offsets)) return std::nullopt;
  index.message_index_length = reader.read<std::uint64_t>();
  index.compression = take_text(reader);
  index.compressed_size = reader.read<std::uint64_t>();
  index.uncompressed_size = reader.read<std::uint64_t>();
  return parsed(reader, std::move(index));
}
std::optional<McapStatistics> parse_statistics(BytesView content) {
  ByteReader reader(content);
  McapStatistics statistics;
  statistics.message_count = reader.read<std::uint64_t>();
  statistics.schema_count = reader.read<std::uint16_t>();
  statistics.channel_count = reader.read<std::uint32_t>();
  statistics.attachment_count = reader.read<std::uint32_t>();
  statistics.metadata_count = reader.read<std::uint32_t>();
  statistics.chunk_count = reader.read<std::uint32_t>();
  statistics.start_time = reader.read<std::uint64_t>();
  statistics.end_time = reader.read<std::uint64_t>();
  if (!take_number_map(reader, statistics.channel_message_counts)) return std::nullopt;
  return parsed(reader, std::move(statistics));
}
std::optional<McapMetadata> parse_metadata(BytesView content) {
  ByteReader reader(content);
  McapMetadata metadata;
  metadata.name = take_text(reader);
  if (!take_string_map(reader, metadata.entries)) return std::nullopt;
  return parsed(reader, std::move(metadata));
}
std::optional<McapMetadataIndex> parse_metadata_index(BytesView content) {
  ByteReader reader(content);
  McapMetadataIndex index;
  index.offset = reader.read<std::uint64_t>();
  index.length = reader.read<std::uint64_t>();
  index.name = take_text(reader);
  return parsed(reader, std::move(index));
}
std::optional<McapFooter> parse_footer(BytesView content) {
  ByteReader reader(content);
  McapFooter footer;
  footer.summary_start = reader.read<std::uint64_t>();
  footer.summary_offset_start = reader.read<std::uint64_t>();
  footer.summary_crc = reader.read<std::uint32_t>();
  return parsed(reader, footer);
}

std::optional<RecordView> RecordWalker::next() {
  if (!reader_.ok() || reader_.remaining() == 0) return std::nullopt;
  RecordView record;
  record.offset = reader_.position();
  record.opcode = reader_.read<Opcode>();
  record.content = reader_.read_bytes(reader_.read<std::uint64_t>());
  return parsed(reader_, record);
}

}  // namespace trocar::journal
