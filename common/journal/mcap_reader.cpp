#include "common/journal/mcap_reader.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>

#include "common/base/checksum.h"

namespace trocar::journal {
namespace {

constexpr std::uint64_t kFooterBytes = kRecordHeaderBytes + kFooterContentBytes;
constexpr std::uint64_t kMaxHeaderBytes = 64 * 1024;
constexpr std::uint64_t kMaxMetadataBytes = 1 << 20;
constexpr std::uint64_t kMaxSummaryBytes = 512u << 20;

bool is_magic(BytesView bytes) {
  return std::equal(bytes.begin(), bytes.end(), kMcapMagic.begin(), kMcapMagic.end());
}
// A record's fixed part: opcode and length.
struct RecordHeader {
  Opcode opcode;
  std::uint64_t length;
};
RecordHeader record_header(BytesView bytes) {
  ByteReader reader(bytes);
  const auto opcode = reader.read<Opcode>();
  return {opcode, reader.read<std::uint64_t>()};
}

}  // namespace

Result<std::unique_ptr<McapReader>> McapReader::open(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return Error{ErrorCode::BadFile, path + ": cannot open: " + std::strerror(errno)};
  struct stat status {};
  const bool is_file = fstat(fd, &status) == 0 && S_ISREG(status.st_mode);
  std::unique_ptr<McapReader> reader(
      new McapReader(path, fd, is_file ? static_cast<std::uint64_t>(status.st_size) : 0));
  if (!is_file) return Error{ErrorCode::BadFile, path + ": not a regular file"};
  if (Status opened = reader->open_header(); !opened.ok()) return opened.error();
  if (!reader->open_summary()) reader->scan();
  reader->sort_chunks();
  return reader;
}

McapReader::~McapReader() {
  ::close(fd_);
}

Result<Bytes> McapReader::read_bytes(std::uint64_t offset, std::uint64_t length) const {
  if (offset > size_ || length > size_ - offset)
    return damaged(offset, "says " + std::to_string(length) + " bytes where the file has fewer");
  Bytes bytes(static_cast<std::size_t>(length));
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count =
        pread(fd_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(offset + done));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0)
      return Error{ErrorCode::BadFile, path_ + ": cannot read: " + std::strerror(errno)};
    if (count == 0) return damaged(offset, "the file became shorter while it was read");
    done += static_cast<std::size_t>(count);
  }
  return bytes;
}

Error McapReader::damaged(std::uint64_t offset, const std::string& what) const {
  return {ErrorCode::BadFile, path_ + ": damaged at byte " + std::to_string(offset) + ": " + what};
}

Status McapReader::open_header() {
  const std::uint64_t fixed = kMcapMagic.size() + kRecordHeaderBytes;
  const Error no_mcap{ErrorCode::BadFile, path_ + ": not an MCAP recording"};
  if (size_ < fixed) return no_mcap;
  const auto start = read_bytes(0, fixed);
  if (!start.ok()) return start.error();
  const BytesView view(*start);
  const RecordHeader record = record_header(view.subspan(kMcapMagic.size()));
  if (!is_magic(view.first(kMcapMagic.size())) || record.opcode != Opcode::Header ||
      record.length > kMaxHeaderBytes)
    return no_mcap;
  const auto content = read_bytes(fixed, record.length);
  if (!content.ok()) return content.error();
  auto header = parse_header(*content);
  if (!header) return no_mcap;
  header_ = std::move(*header);
  data_start_ = fixed + record.length;
  return {};
}

// True if the file ends with a summary that is whole and consistent.
bool McapReader::open_summary() {
  const std::uint64_t tail_bytes = kFooterBytes + kMcapMagic.size();
  if (size_ < data_start_ + tail_bytes) return false;
  const auto tail = read_bytes(size_ - tail_bytes, tail_bytes);
  if (!tail.ok() || !is_magic(BytesView(*tail).last(kMcapMagic.size()))) return false;
  const RecordHeader record = record_header(*tail);
  if (record.opcode != Opcode::Footer || record.length != kFooterContentBytes) return false;
  const auto footer =
      parse_footer(BytesView(*tail).subspan(kRecordHeaderBytes, kFooterContentBytes));
  const std::uint64_t footer_at = size_ - tail_bytes;
  if (!footer || footer->summary_start < data_start_ || footer->summary_start > footer_at ||
      footer_at - footer->summary_start > kMaxSummaryBytes)
    return false;

  const std::uint64_t summary_bytes = footer_at - footer->summary_start;
  const auto checked = read_bytes(footer->summary_start, summary_bytes + kFooterBytes - 4);
  if (!checked.ok() || (footer->summary_crc != 0 && crc32(*checked) != footer->summary_crc))
    return false;
  RecordWalker walker(BytesView(*checked).first(static_cast<std::size_t>(summary_bytes)));
  bool valid = true;
  while (const auto entry = walker.next())
    valid = valid && read_summary_record(*entry, footer->summary_start);
  if (!valid || !walker.ok()) {
    forget_index();
    return false;
  }
  is_finished_ = true;
  summary_start_ = footer->summary_start;
  return true;
}

Status McapReader::check_data_crc() const {
  constexpr std::uint64_t kPieceBytes = 1 << 20, kDataEndBytes = kRecordHeaderBytes + 4;
  if (!is_finished_) return {};
  if (summary_start_ < data_start_ + kDataEndBytes)
    return damaged(summary_start_, "no end of the data before the summary");
  const std::uint64_t end_at = summary_start_ - kDataEndBytes;
  const auto end = read_bytes(end_at, kDataEndBytes);
  if (!end.ok()) return end.error();
  if (record_header(*end).opcode != Opcode::DataEnd || record_header(*end).length != 4)
    return damaged(end_at, "no end of the data before the summary");
  ByteReader reader(BytesView(*end).subspan(kRecordHeaderBytes));
  const auto expected = reader.read<std::uint32_t>();
  if (expected == 0) return {};
  std::uint32_t crc = 0;
  for (std::uint64_t at = 0; at < end_at; at += kPieceBytes) {
    const auto piece = read_bytes(at, std::min(kPieceBytes, end_at - at));
    if (!piece.ok()) return piece.error();
    crc = crc32(*piece, crc);
  }
  if (crc != expected) return damaged(end_at, "the CRC of all data does not match");
  return {};
}

bool McapReader::read_summary_record(const RecordView& record, std::uint64_t summary_start) {
  switch (record.opcode) {
    case Opcode::Schema: {
      auto schema = parse_schema(record.content);
      if (!schema) return false;
      schemas_.insert_or_assign(schema->id, std::move(*schema));
      return true;
    }
    case Opcode::Channel: {
      auto channel = parse_channel(record.content);
      if (!channel) return false;
      channels_.insert_or_assign(channel->id, std::move(*channel));
      return true;
    }
    case Opcode::Statistics: {
      auto statistics = parse_statistics(record.content);
      if (!statistics || statistics->start_time > statistics->end_time) return false;
      statistics_ = std::move(*statistics);
      return true;
    }
    case Opcode::ChunkIndex: {
      auto index = parse_chunk_index(record.content);
      if (!index || index->chunk_offset < data_start_ || index->chunk_offset > summary_start ||
          index->chunk_length < kRecordHeaderBytes ||
          index->chunk_length > summary_start - index->chunk_offset ||
          index->start_time > index->end_time)
        return false;
      chunks_.push_back(std::move(*index));
      return true;
    }
    case Opcode::MetadataIndex: {
      const auto index = parse_metadata_index(record.content);
      return index && read_metadata(*index);
    }
    default:
      return true;
  }
}

bool McapReader::read_metadata(const McapMetadataIndex& index) {
  if (index.length < kRecordHeaderBytes || index.length > kMaxMetadataBytes) return false;
  const auto bytes = read_bytes(index.offset, index.length);
  if (!bytes.ok()) return false;
  RecordWalker walker(*bytes);
  const auto record = walker.next();
  if (!record || record->opcode != Opcode::Metadata) return false;
  auto metadata = parse_metadata(record->content);
  if (!metadata) return false;
  metadata_.push_back(std::move(*metadata));
  return true;
}

void McapReader::forget_index() {
  schemas_.clear();
  channels_.clear();
  metadata_.clear();
  chunks_.clear();
  statistics_ = {};
}

// Rebuilds the index from the data section.
void McapReader::scan() {
  std::uint64_t offset = data_start_;
  while (size_ - offset >= kRecordHeaderBytes) {
    const auto fixed = read_bytes(offset, kRecordHeaderBytes);
    if (!fixed.ok()) break;
    const RecordHeader record = record_header(*fixed);
    if (record.length > size_ - offset - kRecordHeaderBytes) break;
    const std::uint64_t length = kRecordHeaderBytes + record.length;
    if (record.opcode == Opcode::DataEnd) {  // what follows is summary, not data
      offset = size_;
      break;
    }
    if (!scan_record(record.opcode, offset, length)) break;
    offset += length;
  }
  dropped_bytes_ += size_ - offset;
  statistics_.schema_count = static_cast<std::uint16_t>(schemas_.size());
  statistics_.channel_count = static_cast<std::uint32_t>(channels_.size());
  statistics_.metadata_count = static_cast<std::uint32_t>(metadata_.size());
  statistics_.chunk_count = static_cast<std::uint32_t>(chunks_.size());
}

// False: from here on nothing can be trusted.
bool McapReader::scan_record(Opcode opcode, std::uint64_t offset, std::uint64_t length) {
  switch (opcode) {
    case Opcode::Chunk:
      if (!scan_chunk(offset, length)) dropped_bytes_ += length;
      return true;
    case Opcode::Metadata:
      if (!read_metadata({offset, length, {}})) dropped_bytes_ += length;
      return true;
    case Opcode::MessageIndex:
    case Opcode::Attachment:
      return true;
    case Opcode::Schema:
    case Opcode::Channel:
    case Opcode::Message:
      return true;  // outside chunks: of writers that keep no index
    default:
      return static_cast<std::uint8_t>(opcode) >= 0x80;  // private records are skipped
  }
}

bool McapReader::scan_chunk(std::uint64_t offset, std::uint64_t length) {
  if (length > kMaxChunkBytes + (1u << 20)) return false;
  const auto bytes = read_bytes(offset, length);
  if (!bytes.ok()) return false;
  const auto chunk = parse_chunk(BytesView(*bytes).subspan(kRecordHeaderBytes));
  Bytes records;
  if (!chunk || !decompress(*chunk, records).ok()) return false;

  McapChunkIndex index;
  index.start_time = ~std::uint64_t{0};
  index.chunk_offset = offset;
  index.chunk_length = length;
  index.compression = chunk->compression;
  index.compressed_size = chunk->records.size();
  index.uncompressed_size = chunk->uncompressed_size;
  std::map<std::uint16_t, std::uint64_t> counts;
  std::map<std::uint16_t, McapSchema> schemas;
  std::map<std::uint16_t, McapChannel> channels;
  RecordWalker walker(records);
  while (const auto record = walker.next()) {
    if (record->opcode == Opcode::Schema) {
      auto schema = parse_schema(record->content);
      if (!schema) return false;
      schemas.insert_or_assign(schema->id, std::move(*schema));
    } else if (record->opcode == Opcode::Channel) {
      auto channel = parse_channel(record->content);
      if (!channel) return false;
      channels.insert_or_assign(channel->id, std::move(*channel));
    } else if (record->opcode == Opcode::Message) {
      const auto message = parse_message(record->content);
      if (!message) return false;
      index.start_time = std::min(index.start_time, message->log_time);
      index.end_time = std::max(index.end_time, message->log_time);
      ++counts[message->channel_id];
    }
  }
  if (!walker.ok()) return false;
  schemas_.merge(schemas);
  channels_.merge(channels);
  if (counts.empty()) return true;

  McapStatistics& s = statistics_;
  s.start_time = s.message_count == 0 ? index.start_time : std::min(s.start_time, index.start_time);
  s.end_time = std::max(s.end_time, index.end_time);
  for (const auto& [channel, count] : counts) {
    index.message_index_offsets[channel] = 0;  // present; the record itself is not needed
    s.channel_message_counts[channel] += count;
    s.message_count += count;
  }
  chunks_.push_back(std::move(index));
  return true;
}

void McapReader::sort_chunks() {
  std::stable_sort(chunks_.begin(), chunks_.end(),
                   [](const McapChunkIndex& a, const McapChunkIndex& b) {
                     return a.start_time != b.start_time ? a.start_time < b.start_time
                                                         : a.chunk_offset < b.chunk_offset;
                   });
}

std::string McapReader::summary_text() const {
  const double seconds = static_cast<double>(statistics_.end_time - statistics_.start_time) * 1e-9;
  char text[128];
  if (is_finished_)
    std::snprintf(text, sizeof text, "finished recording: %.1f s", seconds);
  else
    std::snprintf(text, sizeof text, "unfinished recording: %.1f s recovered, %llu bytes dropped",
                  seconds, static_cast<unsigned long long>(dropped_bytes_));
  return text;
}

Status McapReader::decompress(const McapChunk& chunk, Bytes& records) const {
  const auto failed = [](const std::string& what) { return Error{ErrorCode::BadFile, what}; };
  if (chunk.uncompressed_size > kMaxChunkBytes) return failed("chunk over the limit of 64 MiB");
  if (chunk.compression.empty()) {
    if (chunk.records.size() != chunk.uncompressed_size) return failed("chunk size does not match");
    records.assign(chunk.records.begin(), chunk.records.end());
  } else if (chunk.compression == "zstd") {
    records.resize(static_cast<std::size_t>(chunk.uncompressed_size));
    const std::size_t size =
        ZSTD_decompress(records.data(), records.size(), chunk.records.data(), chunk.records.size());
    if (ZSTD_isError(size) || size != records.size()) return failed("chunk does not decompress");
  } else {
    return failed("compression '" + std::string(chunk.compression) + "' is not supported");
  }
  if (chunk.uncompressed_crc != 0 && crc32(records) != chunk.uncompressed_crc)
    return failed("chunk CRC does not match");
  return {};
}

Result<McapReader::SharedChunk> McapReader::load(std::size_t at) {
  if (last_chunk_ && last_chunk_->index == at) return last_chunk_;
  const McapChunkIndex& index = chunks_[at];
  if (index.chunk_length > kMaxChunkBytes + (1u << 20))
    return damaged(index.chunk_offset, "chunk over the limit of 64 MiB");
  const auto bytes = read_bytes(index.chunk_offset, index.chunk_length);
  if (!bytes.ok()) return bytes.error();
  const RecordHeader record = record_header(*bytes);
  const auto chunk = parse_chunk(BytesView(*bytes).subspan(kRecordHeaderBytes));
  if (record.opcode != Opcode::Chunk || record.length != bytes->size() - kRecordHeaderBytes ||
      !chunk)
    return damaged(index.chunk_offset, "no chunk where the index says");

  auto loaded = std::make_shared<LoadedChunk>();
  loaded->index = at;
  if (Status status = decompress(*chunk, loaded->records); !status.ok())
    return damaged(index.chunk_offset, status.error().message);
  RecordWalker walker(loaded->records);
  while (const auto entry = walker.next()) {
    if (entry->opcode != Opcode::Message) continue;
    const auto message = parse_message(entry->content);
    if (!message || !channels_.contains(message->channel_id))
      return damaged(index.chunk_offset, "message without a channel");
    loaded->messages.push_back(*message);
  }
  if (!walker.ok()) return damaged(index.chunk_offset, "chunk holds half a record");
  std::stable_sort(
      loaded->messages.begin(), loaded->messages.end(),
      [](const McapMessage& a, const McapMessage& b) { return a.log_time < b.log_time; });
  last_chunk_ = loaded;
  return last_chunk_;
}

ReadReport McapReader::read(const ChannelFilter& filter, const TimeRange& range,
                            const MessageVisitor& visitor) {
  const auto wants = [&](std::uint16_t id) {
    const auto channel = channels_.find(id);
    return channel != channels_.end() && (!filter || filter(channel->second));
  };
  struct Cursor {
    SharedChunk chunk;
    std::size_t next = 0;
    std::uint64_t time() const { return chunk->messages[next].log_time; }
  };
  ReadReport report;
  std::vector<Cursor> active;  // chunks whose time ranges overlap; in our own files one or two
  std::size_t next_chunk = 0;
  const auto earliest = [&active] {
    return std::min_element(active.begin(), active.end(), [](const Cursor& a, const Cursor& b) {
      return a.time() < b.time();  // the first of equals: the chunk that starts first
    });
  };
  // Moves a cursor to its next wanted message; false at its end.
  const auto settle = [&](Cursor& cursor) {
    const auto& messages = cursor.chunk->messages;
    while (cursor.next < messages.size() && (messages[cursor.next].log_time < range.from ||
                                             !wants(messages[cursor.next].channel_id)))
      ++cursor.next;
    return cursor.next < messages.size() && cursor.time() <= range.to;
  };
  while (true) {
    for (; next_chunk < chunks_.size(); ++next_chunk) {
      const McapChunkIndex& index = chunks_[next_chunk];
      if (index.start_time > range.to)
        next_chunk = chunks_.size() - 1;  // nothing later counts
      else if (!active.empty() && index.start_time > earliest()->time())
        break;
      if (index.start_time > range.to || index.end_time < range.from) continue;
      const auto& present = index.message_index_offsets;
      // Without message indexes nobody knows which channels a chunk has.
      if (!present.empty() && std::none_of(present.begin(), present.end(),
                                           [&](const auto& entry) { return wants(entry.first); }))
        continue;
      auto loaded = load(next_chunk);
      if (!loaded.ok()) {
        if (report.damaged_chunks++ == 0) report.first_damage = loaded.error();
        continue;
      }
      if (Cursor cursor{*loaded, 0}; settle(cursor)) active.push_back(std::move(cursor));
    }
    if (active.empty()) return report;
    const auto cursor = earliest();
    ++report.messages;
    if (!visitor(cursor->chunk->messages[cursor->next])) return report;
    ++cursor->next;
    if (!settle(*cursor)) active.erase(cursor);
  }
}

Result<std::unique_ptr<OwnedMessage>> McapReader::last_before(std::string_view topic,
                                                              std::uint64_t time) {
  const auto is_wanted = [&](std::uint16_t id) {
    const auto channel = channels_.find(id);
    return channel != channels_.end() && channel->second.topic == topic;
  };
  std::unique_ptr<OwnedMessage> best;
  for (std::size_t at = chunks_.size(); at-- > 0;) {
    const McapChunkIndex& index = chunks_[at];
    if (index.start_time > time || (best && index.end_time < best->log_time)) continue;
    const auto& present = index.message_index_offsets;
    if (!present.empty() && std::none_of(present.begin(), present.end(),
                                         [&](const auto& entry) { return is_wanted(entry.first); }))
      continue;
    auto loaded = load(at);
    if (!loaded.ok()) return loaded.error();
    const auto& messages = (*loaded)->messages;
    const auto found = std::find_if(messages.rbegin(), messages.rend(), [&](const McapMessage& m) {
      return m.log_time <= time && is_wanted(m.channel_id);
    });
    if (found == messages.rend() || (best && found->log_time <= best->log_time)) continue;
    best = std::make_unique<OwnedMessage>(
        OwnedMessage{found->channel_id, found->log_time, found->publish_time,
                     Bytes(found->data.begin(), found->data.end())});
  }
  return best;
}

}  // namespace trocar::journal
