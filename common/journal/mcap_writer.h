#pragma once

// Writes MCAP so that a process killed at any moment loses at most the open chunk.
//
// A chunk and its indexes are built in memory and leave in one write(); the file always ends on a
// record boundary. A chunk closes after 250 ms of log time or 256 KiB, whichever comes first; a
// message over 64 KiB gets a chunk of its own, so that reading the small channels skips it. Each
// chunk repeats the schemas and channels that its messages use: any chunk can be read alone.
// close() adds summary and footer. With `sync_ns` a power failure, too, loses little: chunks are
// then brought to the disk while it is written.
//
// Memory: one chunk, plus some 200 bytes of index per chunk written. One thread. After an error
// every call returns it again and nothing more is written.

#include <functional>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/journal/mcap_records.h"

struct ZSTD_CCtx_s;

namespace trocar::journal {

struct McapWriterOptions {
  std::uint64_t chunk_ns = 250'000'000;
  std::size_t chunk_bytes = 256 * 1024;
  std::size_t isolate_bytes = 64 * 1024;
  bool compress = true;  // zstd level 1, where that is smaller
  // A chunk that ends so long after the last sync is followed by one. 0: only close() syncs.
  std::uint64_t sync_ns = 0;
  std::function<std::uint64_t()> clock_ns;  // monotonic; empty: the system's
  std::function<int(int fd)> synchronise;   // as fdatasync; empty: that
};

class McapWriter {
 public:
  // Error (BadFile) if a file of that name exists: a recording is never overwritten. (A device may
  // exist.) Nothing is left where the first bytes cannot be written.
  static Result<std::unique_ptr<McapWriter>> create(const std::string& path,
                                                    const McapHeader& header,
                                                    const McapWriterOptions& options = {});
  ~McapWriter();  // closes the file without the open chunk and without a summary, like a crash
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;

  // Ids to write with. Nothing reaches the file until a message uses them.
  std::uint16_t add_schema(std::string name, std::string encoding, Bytes data);
  std::uint16_t add_channel(std::string topic, std::string message_encoding,
                            std::uint16_t schema_id, StringMap metadata = {});

  // log_time_ns must not decrease; sequence numbers count per channel.
  [[nodiscard]] Status write(std::uint16_t channel_id, std::uint64_t log_time_ns,
                             std::uint64_t publish_time_ns, BytesView data);
  [[nodiscard]] Status write_metadata(const McapMetadata& metadata);  // at once
  [[nodiscard]] Status flush();  // ends the open chunk, if it has a message
  [[nodiscard]] Status sync();   // fdatasync of what was written: survives loss of power
  [[nodiscard]] Status close();  // flush, summary, footer, fdatasync; call once

  std::uint64_t bytes_written() const { return file_offset_; }
  std::uint64_t sync_count() const { return sync_count_; }
  const McapStatistics& statistics() const { return statistics_; }

 private:
  struct ChannelState {
    McapChannel channel;
    std::uint32_t next_sequence = 0;
    bool is_used = false;                     // in any chunk
    bool is_in_chunk = false;                 // in the open one
    std::vector<MessageTimeAndOffset> index;  // of the open chunk
  };
  struct SchemaState {
    McapSchema schema;
    bool is_used = false, is_in_chunk = false;
  };

  McapWriter(std::string path, int fd, const McapWriterOptions& options);
  void declare(ChannelState& state);
  BytesView compress_chunk();
  Status append(BytesView bytes);
  Status sync_if_due();
  Status write_summary();

  std::string path_;
  int fd_;
  McapWriterOptions options_;
  ZSTD_CCtx_s* zstd_;
  Status failure_;
  std::uint64_t file_offset_ = 0;
  std::uint32_t data_crc_ = 0;
  std::uint64_t last_log_time_ = 0;
  std::uint64_t last_sync_ns_ = 0, sync_count_ = 0;

  std::vector<SchemaState> schemas_;    // [id - 1]
  std::vector<ChannelState> channels_;  // [id - 1]
  Bytes chunk_, compressed_, record_;   // uncompressed records; buffers kept between chunks
  std::uint64_t chunk_start_ = 0, chunk_end_ = 0;
  std::size_t chunk_messages_ = 0;

  std::vector<McapChunkIndex> chunk_indexes_;
  std::vector<McapMetadataIndex> metadata_indexes_;
  McapStatistics statistics_;
};

}  // namespace trocar::journal
