#pragma once

// Reads MCAP files, finished or not. Knows nothing of Trocar.
//
// open() takes the summary if the file has a sound one. Otherwise - the writer was killed, is still
// writing, or the file is damaged - it scans forward, checks each chunk's CRC, skips a bad chunk by
// its length, stops at the first record that does not fit, and rebuilds the index in memory.
// No length in the file is trusted: each is checked against the bytes that are there, and a chunk
// over kMaxChunkBytes is damaged. Reads with pread, so a file that grows or shrinks meanwhile is
// harmless; what is added after open() is not seen. Only messages in chunks are read (our writer,
// and any that writes an index, puts them all there). Memory: the index, one decompressed chunk per
// overlapping time range, and the last chunk used. One thread per reader.

#include <functional>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/journal/mcap_records.h"

namespace trocar::journal {

struct TimeRange {
  std::uint64_t from = 0;                // ns, inclusive
  std::uint64_t to = ~std::uint64_t{0};  // ns, inclusive
};

struct ReadReport {
  std::uint64_t messages = 0;        // visited
  std::uint64_t damaged_chunks = 0;  // skipped
  Error first_damage;                // valid if damaged_chunks > 0

  Status status() const { return damaged_chunks > 0 ? Status(first_damage) : Status(); }
};

// Returns false to stop reading. The message's bytes are valid only during the call.
using MessageVisitor = std::function<bool(const McapMessage&)>;
// The filter says which channels to read; without one, all are read.
using ChannelFilter = std::function<bool(const McapChannel&)>;

struct OwnedMessage {
  std::uint16_t channel_id = 0;
  std::uint64_t log_time = 0, publish_time = 0;
  Bytes data;
};

class McapReader {
 public:
  static Result<std::unique_ptr<McapReader>> open(const std::string& path);
  ~McapReader();
  McapReader(const McapReader&) = delete;
  McapReader& operator=(const McapReader&) = delete;

  const std::string& path() const { return path_; }
  const McapHeader& header() const { return header_; }
  const std::map<std::uint16_t, McapSchema>& schemas() const { return schemas_; }
  const std::map<std::uint16_t, McapChannel>& channels() const { return channels_; }
  const std::vector<McapMetadata>& metadata() const { return metadata_; }
  // These are as the file says or, if it was recovered, as counted.
  const McapStatistics& statistics() const { return statistics_; }
  // By start time.
  const std::vector<McapChunkIndex>& chunks() const { return chunks_; }
  // False: there was no sound summary, and the index was rebuilt.
  bool is_finished() const { return is_finished_; }
  std::uint64_t dropped_bytes() const { return dropped_bytes_; }
  // One line for people: "finished recording: 12.3 s" or "unfinished recording: 12.3 s recovered,
  // 456 bytes dropped".
  std::string summary_text() const;

  // Visits messages in order of log time (within one, in order of writing). Damaged chunks are
  // reported and skipped, the others are still read.
  ReadReport read(const ChannelFilter& filter, const TimeRange& range,
                  const MessageVisitor& visitor);
  // Compares the file's bytes with the CRC of its data section, which also covers what read() does
  // not need: indexes, metadata, records outside chunks. Ok if there is none: the file has no end,
  // or its writer gave no CRC. Reads the whole file.
  Status check_data_crc() const;
  // The last message on `topic` at or before `time`. Nothing if there is none; an error if the
  // chunk that should hold it is damaged.
  Result<std::unique_ptr<OwnedMessage>> last_before(std::string_view topic, std::uint64_t time);

 private:
  struct LoadedChunk {
    std::size_t index = 0;  // into chunks_
    Bytes records;
    std::vector<McapMessage> messages;  // by log time, then position; views into `records`
  };
  using SharedChunk = std::shared_ptr<const LoadedChunk>;

  McapReader(std::string path, int fd, std::uint64_t size)
      : path_(std::move(path)), fd_(fd), size_(size) {}

  Result<Bytes> read_bytes(std::uint64_t offset, std::uint64_t length) const;
  Status open_header();
  bool open_summary();
  bool read_summary_record(const RecordView& record, std::uint64_t summary_start);
  bool read_metadata(const McapMetadataIndex& index);
  void forget_index();
  void scan();
  bool scan_record(Opcode opcode, std::uint64_t offset, std::uint64_t length);
  bool scan_chunk(std::uint64_t offset, std::uint64_t length);
  void sort_chunks();
  Status decompress(const McapChunk& chunk, Bytes& records) const;
  Result<SharedChunk> load(std::size_t index);
  Error damaged(std::uint64_t offset, const std::string& what) const;

  std::string path_;
  int fd_;
  std::uint64_t size_;
  std::uint64_t data_start_ = 0;  // after the header record
  McapHeader header_;
  std::map<std::uint16_t, McapSchema> schemas_;
  std::map<std::uint16_t, McapChannel> channels_;
  std::vector<McapMetadata> metadata_;
  std::vector<McapChunkIndex> chunks_;
  McapStatistics statistics_;
  bool is_finished_ = false;
  std::uint64_t summary_start_ = 0;  // of a finished file
  std::uint64_t dropped_bytes_ = 0;
  SharedChunk last_chunk_;
};

}  // namespace trocar::journal
