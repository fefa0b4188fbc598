#pragma once

// Records of the MCAP container (https://mcap.dev/spec, version 0): types, writing, parsing.
//
//   file   = magic Header { Metadata | Chunk MessageIndex... } DataEnd summary Footer magic
//   record = u8 opcode, u64 content length, content; integers little-endian
//   String = u32 byte length + UTF-8, Map and Array = u32 byte length + entries, time = u64 ns
//   CRC    = CRC-32 (zlib), 0 means not computed
//
// Parsers take the content of one record. They never read past it and ignore fields after those
// they know, as the format asks; nothing means malformed. Knows nothing of Trocar.

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/bytes.h"

namespace trocar::journal {

inline constexpr std::array<std::uint8_t, 8> kMcapMagic{0x89, 'M', 'C', 'A', 'P', 0x30, '\r', '\n'};
inline constexpr std::size_t kRecordHeaderBytes = 9;
inline constexpr std::size_t kFooterContentBytes = 20;
// A chunk that says it is larger, compressed or not, is damaged: no length is trusted beyond this.
inline constexpr std::uint64_t kMaxChunkBytes = 64u << 20;

enum class Opcode : std::uint8_t {
  Header = 0x01,
  Footer = 0x02,
  Schema = 0x03,
  Channel = 0x04,
  Message = 0x05,
  Chunk = 0x06,
  MessageIndex = 0x07,
  ChunkIndex = 0x08,
  Attachment = 0x09,
  AttachmentIndex = 0x0a,
  Statistics = 0x0b,
  Metadata = 0x0c,
  MetadataIndex = 0x0d,
  SummaryOffset = 0x0e,
  DataEnd = 0x0f,
};

using StringMap = std::map<std::string, std::string>;

struct McapHeader {
  std::string profile, library;
};
struct McapSchema {
  std::uint16_t id = 0;  // not 0
  std::string name, encoding;
  Bytes data;
  bool operator==(const McapSchema&) const = default;
};
struct McapChannel {
  std::uint16_t id = 0;
  std::uint16_t schema_id = 0;  // 0: none
  std::string topic, message_encoding;
  StringMap metadata;
  bool operator==(const McapChannel&) const = default;
};
struct McapMessage {
  std::uint16_t channel_id = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time = 0;      // ns
  std::uint64_t publish_time = 0;  // ns
  BytesView data;                  // valid as long as the bytes it was parsed from
};
struct McapChunk {
  std::uint64_t start_time = 0, end_time = 0;
  std::uint64_t uncompressed_size = 0;
  std::uint32_t uncompressed_crc = 0;
  std::string_view compression;  // "", "zstd"
  BytesView records;             // compressed
};
struct McapChunkIndex {
  std::uint64_t start_time = 0, end_time = 0;
  std::uint64_t chunk_offset = 0, chunk_length = 0;  // in the file, record header included
  std::map<std::uint16_t, std::uint64_t> message_index_offsets;  // channels that have messages
  std::uint64_t message_index_length = 0;
  std::string compression;
  std::uint64_t compressed_size = 0, uncompressed_size = 0;
};
struct McapStatistics {
  std::uint64_t message_count = 0;
  std::uint16_t schema_count = 0;
  std::uint32_t channel_count = 0, attachment_count = 0, metadata_count = 0, chunk_count = 0;
  std::uint64_t start_time = 0, end_time = 0;  // ns, of all messages; 0 if there are none
  std::map<std::uint16_t, std::uint64_t> channel_message_counts;
};
struct McapMetadata {
  std::string name;
  StringMap entries;
};
struct McapMetadataIndex {
  std::uint64_t offset = 0, length = 0;
  std::string name;
};
struct McapFooter {
  std::uint64_t summary_start = 0, summary_offset_start = 0;
  std::uint32_t summary_crc = 0;
};

// Writes one record on destruction of the scope: puts the opcode, and the length once it is known.
class RecordScope {
 public:
  RecordScope(Bytes& out, Opcode opcode);
  ~RecordScope();
  RecordScope(const RecordScope&) = delete;
  RecordScope& operator=(const RecordScope&) = delete;

 private:
  Bytes& out_;
  std::size_t content_at_;
};

// These append a whole record each.
void put_header(Bytes& out, const McapHeader& header);
void put_schema(Bytes& out, const McapSchema& schema);
void put_channel(Bytes& out, const McapChannel& channel);
void put_message(Bytes& out, const McapMessage& message);
void put_chunk(Bytes& out, const McapChunk& chunk);
struct MessageTimeAndOffset {
  std::uint64_t log_time, offset;  // of the Message's opcode byte in the uncompressed records
};
void put_message_index(Bytes& out, std::uint16_t channel_id,
                       const std::vector<MessageTimeAndOffset>& entries);
void put_chunk_index(Bytes& out, const McapChunkIndex& index);
void put_statistics(Bytes& out, const McapStatistics& statistics);
void put_metadata(Bytes& out, const McapMetadata& metadata);
void put_metadata_index(Bytes& out, const McapMetadataIndex& index);
void put_summary_offset(Bytes& out, Opcode group, std::uint64_t start, std::uint64_t length);
void put_data_end(Bytes& out, std::uint32_t data_section_crc);

std::optional<McapHeader> parse_header(BytesView content);
std::optional<McapSchema> parse_schema(BytesView content);
std::optional<McapChannel> parse_channel(BytesView content);
std::optional<McapMessage> parse_message(BytesView content);
std::optional<McapChunk> parse_chunk(BytesView content);
std::optional<McapChunkIndex> parse_chunk_index(BytesView content);
std::optional<McapStatistics> parse_statistics(BytesView content);
std::optional<McapMetadata> parse_metadata(BytesView content);
std::optional<McapMetadataIndex> parse_metadata_index(BytesView content);
std::optional<McapFooter> parse_footer(BytesView content);

// Walks records that lie one after the other; stops at the end or at the first that does not fit.
struct RecordView {
  Opcode opcode{};
  BytesView content;
  std::size_t offset = 0;  // of the opcode byte
};
class RecordWalker {
 public:
  explicit RecordWalker(BytesView records) : reader_(records) {}

  std::optional<RecordView> next();
  bool ok() const { return reader_.ok(); }  // false: something was left that is no whole record

 private:
  ByteReader reader_;
};

}  // namespace trocar::journal
