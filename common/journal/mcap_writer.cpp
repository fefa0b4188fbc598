#include "common/journal/mcap_writer.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>

#include "common/base/assert.h"
#include "common/base/checksum.h"
#include "common/base/timing.h"

namespace trocar::journal {
namespace {

constexpr int kZstdLevel = 1;  // higher levels cost time and save next to nothing on our streams

// Recordings hold people's names and words: no business of everybody on the machine.
constexpr mode_t kMode = 0640;

Error io_error(const std::string& path, const char* action) {
  const int code = errno;
  return {ErrorCode::ResourceMissing, path + ": cannot " + action + ": " +
                                          std::string(std::strerror(code)) +
                                          (code == ENOSPC  ? "; free some space"
                                           : code == EFBIG ? "; raise the limit of file sizes"
                                                           : "")};
}

bool is_device(const std::string& path) {
  struct stat status {};
  return stat(path.c_str(), &status) == 0 && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode);
}

// The name of a new file survives a loss of power only once its folder was written. A file system
// that cannot do that does no harm.
void sync_folder_of(const std::string& path) {
  const auto folder = std::filesystem::path(path).parent_path();
  const int fd = open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  [[maybe_unused]] const int result = fsync(fd);
  ::close(fd);
}

}  // namespace

Result<std::unique_ptr<McapWriter>> McapWriter::create(const std::string& path,
                                                       const McapHeader& header,
                                                       const McapWriterOptions& options) {
  const int create_flags = is_device(path) ? 0 : O_CREAT | O_EXCL;
  const int fd = open(path.c_str(), O_WRONLY | O_CLOEXEC | create_flags, kMode);
  if (fd < 0 && errno == EEXIST)
    return Error{ErrorCode::BadFile,
                 path + ": exists already; choose another name or move it away"};
  if (fd < 0) return io_error(path, "create");
  std::unique_ptr<McapWriter> writer(new McapWriter(path, fd, options));
  Bytes start(kMcapMagic.begin(), kMcapMagic.end());
  put_header(start, header);
  if (Status written = writer->append(start); !written.ok()) {
    if (create_flags != 0) ::unlink(path.c_str());
    return written.error();
  }
  if (options.sync_ns > 0) sync_folder_of(path);
  return writer;
}

McapWriter::McapWriter(std::string path, int fd, const McapWriterOptions& options)
    : path_(std::move(path)), fd_(fd), options_(options), zstd_(ZSTD_createCCtx()) {
  if (!options_.clock_ns) options_.clock_ns = monotonic_ns;
  if (!options_.synchronise) options_.synchronise = ::fdatasync;
  last_sync_ns_ = options_.clock_ns();
}

McapWriter::~McapWriter() {
  ZSTD_freeCCtx(zstd_);
  if (fd_ >= 0) ::close(fd_);
}

std::uint16_t McapWriter::add_schema(std::string name, std::string encoding, Bytes data) {
  TROCAR_ASSERT(schemas_.size() < 0xffff);
  const auto id = static_cast<std::uint16_t>(schemas_.size() + 1);
  schemas_.push_back({{id, std::move(name), std::move(encoding), std::move(data)}, false, false});
  return id;
}

std::uint16_t McapWriter::add_channel(std::string topic, std::string message_encoding,
                                      std::uint16_t schema_id, StringMap metadata) {
  TROCAR_ASSERT(channels_.size() < 0xffff && schema_id <= schemas_.size());
  const auto id = static_cast<std::uint16_t>(channels_.size() + 1);
  ChannelState state;
  state.channel = {id, schema_id, std::move(topic), std::move(message_encoding),
                   std::move(metadata)};
  channels_.push_back(std::move(state));
  return id;
}

// Repeats the channel and its schema in the open chunk, before its first message there.
void McapWriter::declare(ChannelState& state) {
  if (state.is_in_chunk) return;
  state.is_in_chunk = state.is_used = true;
  if (state.channel.schema_id != 0) {
    SchemaState& schema = schemas_[state.channel.schema_id - 1];
    if (!schema.is_in_chunk) put_schema(chunk_, schema.schema);
    schema.is_in_chunk = schema.is_used = true;
  }
  put_channel(chunk_, state.channel);
}

Status McapWriter::write(std::uint16_t channel_id, std::uint64_t log_time_ns,
                         std::uint64_t publish_time_ns, BytesView data) {
  TROCAR_ASSERT(channel_id >= 1 && channel_id <= channels_.size());
  TROCAR_ASSERT(log_time_ns >= last_log_time_);
  if (!failure_.ok()) return failure_;
  ChannelState& state = channels_[channel_id - 1];
  // Room for schema and channel; a chunk over the cap could be written but not read.
  if (data.size() > kMaxChunkBytes - (1u << 20))
    return Error{ErrorCode::ResourceMissing, path_ + ": message of " + std::to_string(data.size()) +
                                                 " bytes on " + state.channel.topic +
                                                 " is over the limit of 63 MiB"};
  const bool is_isolated = data.size() > options_.isolate_bytes;
  const bool is_full = chunk_messages_ > 0 && log_time_ns - chunk_start_ >= options_.chunk_ns;
  if (is_isolated || is_full)
    if (Status flushed = flush(); !flushed.ok()) return flushed;

  last_log_time_ = log_time_ns;
  declare(state);
  if (chunk_messages_++ == 0) chunk_start_ = log_time_ns;
  chunk_end_ = log_time_ns;
  state.index.push_back({log_time_ns, chunk_.size()});
  put_message(chunk_, {channel_id, state.next_sequence++, log_time_ns, publish_time_ns, data});
  if (is_isolated || chunk_.size() >= options_.chunk_bytes) return flush();
  return {};
}

// The chunk's records as they will be stored: compressed if that is smaller.
BytesView McapWriter::compress_chunk() {
  if (!options_.compress) return chunk_;
  compressed_.resize(ZSTD_compressBound(chunk_.size()));
  const std::size_t size = ZSTD_compressCCtx(zstd_, compressed_.data(), compressed_.size(),
                                             chunk_.data(), chunk_.size(), kZstdLevel);
  if (ZSTD_isError(size) || size >= chunk_.size()) return chunk_;
  return BytesView(compressed_).first(size);
}

Status McapWriter::flush() {
  if (!failure_.ok() || chunk_messages_ == 0) return failure_;
  const BytesView stored = compress_chunk();
  const char* compression = stored.data() == chunk_.data() ? "" : "zstd";

  record_.clear();
  put_chunk(record_, {chunk_start_, chunk_end_, chunk_.size(), crc32(chunk_), compression, stored});
  McapChunkIndex index;
  index.start_time = chunk_start_;
  index.end_time = chunk_end_;
  index.chunk_offset = file_offset_;
  index.chunk_length = record_.size();
  index.compression = compression;
  index.compressed_size = stored.size();
  index.uncompressed_size = chunk_.size();
  for (const ChannelState& state : channels_) {
    if (state.index.empty()) continue;
    index.message_index_offsets[state.channel.id] = file_offset_ + record_.size();
    put_message_index(record_, state.channel.id, state.index);
  }
  index.message_index_length = record_.size() - index.chunk_length;
  if (Status written = append(record_); !written.ok()) return written;

  if (statistics_.message_count == 0) statistics_.start_time = chunk_start_;
  statistics_.end_time = chunk_end_;
  statistics_.message_count += chunk_messages_;
  ++statistics_.chunk_count;
  for (ChannelState& state : channels_) {
    if (!state.index.empty())
      statistics_.channel_message_counts[state.channel.id] += state.index.size();
    state.index.clear();
    state.is_in_chunk = false;
  }
  for (SchemaState& schema : schemas_) schema.is_in_chunk = false;
  chunk_indexes_.push_back(std::move(index));
  chunk_.clear();
  chunk_messages_ = 0;
  return sync_if_due();
}

Status McapWriter::write_metadata(const McapMetadata& metadata) {
  if (!failure_.ok()) return failure_;
  Bytes record;
  put_metadata(record, metadata);
  metadata_indexes_.push_back({file_offset_, record.size(), metadata.name});
  ++statistics_.metadata_count;
  return append(record);
}

Status McapWriter::append(BytesView bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = ::write(fd_, bytes.data() + done, bytes.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      failure_ = io_error(path_, "write");
      // Back to the last whole record. If that fails too, readers drop the torn one.
      [[maybe_unused]] const int result = ftruncate(fd_, static_cast<off_t>(file_offset_));
      return failure_;
    }
    done += static_cast<std::size_t>(count);
  }
  file_offset_ += bytes.size();
  data_crc_ = crc32(bytes, data_crc_);
  return {};
}

Status McapWriter::sync() {
  if (!failure_.ok()) return failure_;
  // A pipe or device cannot be synchronised, and needs not be.
  if (options_.synchronise(fd_) != 0 && errno != EINVAL && errno != EROFS)
    failure_ = io_error(path_, "synchronise");
  ++sync_count_;
  last_sync_ns_ = options_.clock_ns();
  return failure_;
}

Status McapWriter::sync_if_due() {
  if (options_.sync_ns == 0 || options_.clock_ns() - last_sync_ns_ < options_.sync_ns) return {};
  return sync();
}

Status McapWriter::write_summary() {
  Bytes tail;
  put_data_end(tail, data_crc_);
  const std::size_t summary_at = tail.size();
  const std::uint64_t file_at = file_offset_;
  struct Group {
    Opcode opcode;
    std::size_t start, end;
  };
  std::vector<Group> groups;
  const auto put_group = [&](Opcode opcode, auto put_records) {
    const std::size_t start = tail.size();
    put_records();
    if (tail.size() > start) groups.push_back({opcode, start, tail.size()});
  };
  put_group(Opcode::Schema, [&] {
    for (const SchemaState& state : schemas_) {
      if (!state.is_used) continue;
      put_schema(tail, state.schema);
      ++statistics_.schema_count;
    }
  });
  put_group(Opcode::Channel, [&] {
    for (const ChannelState& state : channels_) {
      if (!state.is_used) continue;
      put_channel(tail, state.channel);
      ++statistics_.channel_count;
    }
  });
  put_group(Opcode::Statistics, [&] { put_statistics(tail, statistics_); });
  put_group(Opcode::ChunkIndex, [&] {
    for (const McapChunkIndex& index : chunk_indexes_) put_chunk_index(tail, index);
  });
  put_group(Opcode::MetadataIndex, [&] {
    for (const McapMetadataIndex& index : metadata_indexes_) put_metadata_index(tail, index);
  });
  const std::size_t offsets_at = tail.size();
  for (const Group& group : groups)
    put_summary_offset(tail, group.opcode, file_at + group.start, group.end - group.start);

  // The CRC covers everything from the summary's start up to itself, which is the footer's last
  // field.
  ByteWriter writer(tail);
  writer.put(Opcode::Footer);
  writer.put(std::uint64_t{kFooterContentBytes});
  writer.put(std::uint64_t{file_at + summary_at});
  writer.put(std::uint64_t{file_at + offsets_at});
  writer.put(crc32(BytesView(tail).subspan(summary_at)));
  writer.put_bytes(kMcapMagic);
  return append(tail);
}

Status McapWriter::close() {
  if (Status flushed = flush(); !flushed.ok()) return flushed;
  if (Status written = write_summary(); !written.ok()) return written;
  if (Status synced = sync(); !synced.ok()) return synced;
  const int fd = fd_;
  fd_ = -1;
  if (::close(fd) != 0) failure_ = io_error(path_, "close");
  return failure_;
}

}  // namespace trocar::journal
