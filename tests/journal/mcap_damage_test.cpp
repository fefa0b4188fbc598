// Recordings that were cut short or damaged: what is whole is read, what is not is reported, and no
// length in the file is believed.

#include <gtest/gtest.h>

#include <sys/resource.h>
#include <zstd.h>

#include <csignal>

#include "common/base/checksum.h"
#include "tests/journal/mcap_files.h"

namespace trocar::journal {
namespace {

using namespace testing;  // NOLINT: the helpers of this folder

class mcap_damage : public ::testing::Test {
 protected:
  // Writes a finished recording of 2 s, 8 chunks.
  void SetUp() override {
    auto writer = create(path_);
    ASSERT_TRUE(writer->write_metadata({"note", {{"k", "v"}}}).ok());
    written_ = write_small(*writer, 2000);
    ASSERT_TRUE(writer->close().ok());
    file_ = load_file(path_);
    chunks_ = open(path_)->chunks();
    ASSERT_EQ(chunks_.size(), 8u);
  }

  std::unique_ptr<McapReader> reopen(BytesView bytes) {
    save_file(path_, bytes);
    return open(path_);
  }
  // End of chunk `i` with its indexes.
  std::size_t end_of(std::size_t i) const {
    const McapChunkIndex& c = chunks_[i];
    return c.chunk_offset + c.chunk_length + c.message_index_length;
  }
  std::vector<Expected> written_before(std::uint64_t time) const {
    std::vector<Expected> before;
    for (const Expected& m : written_)
      if (m.log_time < time) before.push_back(m);
    return before;
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.file("a.mcap");
  std::vector<Expected> written_;
  Bytes file_;
  std::vector<McapChunkIndex> chunks_;
};

TEST_F(mcap_damage, unfinished_at_every_chunk_boundary) {
  for (std::size_t whole = 0; whole < chunks_.size(); ++whole) {
    auto reader = reopen(BytesView(file_).first(chunks_[whole].chunk_offset));
    ASSERT_TRUE(reader);
    EXPECT_FALSE(reader->is_finished());
    EXPECT_EQ(reader->chunks().size(), whole);
    EXPECT_EQ(reader->dropped_bytes(), 0u);
    EXPECT_EQ(reader->metadata().size(), 1u);
    const ReadBack back = read_all(*reader);
    EXPECT_TRUE(back.report.status().ok());
    EXPECT_EQ(back.messages, written_before(chunks_[whole].start_time));
    EXPECT_EQ(reader->statistics().message_count, back.messages.size());
  }
}

TEST_F(mcap_damage, truncated_anywhere) {
  std::uint32_t state = 7;
  for (std::size_t round = 0; round < 300; ++round) {
    state = state * 1664525 + 1013904223;
    const std::size_t length = 41 + state % (file_.size() - 41);
    auto reader = reopen(BytesView(file_).first(length));
    ASSERT_TRUE(reader) << length;
    EXPECT_FALSE(reader->is_finished());
    std::size_t whole = 0;
    while (whole < chunks_.size() &&
           chunks_[whole].chunk_offset + chunks_[whole].chunk_length <= length)
      ++whole;
    ASSERT_EQ(reader->chunks().size(), whole) << length;
    const auto next = whole < chunks_.size() ? chunks_[whole].start_time : ~std::uint64_t{0};
    ASSERT_EQ(read_all(*reader).messages, written_before(next)) << length;
  }
  for (std::size_t length = 0; length < 41; ++length) {
    save_file(path_, BytesView(file_).first(length));
    EXPECT_FALSE(McapReader::open(path_).ok()) << length;
  }
}

TEST_F(mcap_damage, torn_chunk_is_counted_in_the_text) {
  auto reader = reopen(BytesView(file_).first(end_of(3) + 100));
  ASSERT_TRUE(reader);
  EXPECT_EQ(reader->dropped_bytes(), 100u);
  EXPECT_EQ(reader->summary_text(), "unfinished recording: 1.0 s recovered, 100 bytes dropped");
}

TEST_F(mcap_damage, flipped_bit_in_a_chunk_is_reported_and_the_others_are_read) {
  std::vector<Expected> others;
  for (const Expected& m : written_)
    if (m.log_time < chunks_[2].start_time || m.log_time > chunks_[2].end_time) others.push_back(m);
  for (std::size_t at = 60; at < chunks_[2].chunk_length; at += 97) {
    Bytes bytes = file_;
    bytes[chunks_[2].chunk_offset + at] ^= 0x10;
    auto reader = reopen(bytes);
    ASSERT_TRUE(reader);
    const ReadBack back = read_all(*reader);
    EXPECT_EQ(back.report.damaged_chunks, 1u);
    ASSERT_FALSE(back.report.status().ok());
    EXPECT_NE(back.report.first_damage.message.find("damaged at byte"), std::string::npos);
    EXPECT_EQ(back.messages, others);
    EXPECT_FALSE(reader->last_before("/a", chunks_[2].end_time).ok());
    EXPECT_TRUE(reader->last_before("/a", chunks_[4].end_time).ok());
    // The same damage in an unfinished file: the chunk is skipped by its length.
    auto recovered = reopen(BytesView(bytes).first(end_of(6)));
    ASSERT_TRUE(recovered);
    EXPECT_EQ(recovered->chunks().size(), 6u);
    EXPECT_EQ(recovered->dropped_bytes(), chunks_[2].chunk_length);
    EXPECT_TRUE(read_all(*recovered).report.status().ok());
  }
}

TEST_F(mcap_damage, no_flipped_bit_anywhere_goes_unnoticed) {
  ASSERT_TRUE(reopen(file_)->check_data_crc().ok());
  for (std::size_t at = 0; at < file_.size(); at += 61) {
    Bytes bytes = file_;
    bytes[at] ^= 0x20;
    save_file(path_, bytes);
    auto reader = McapReader::open(path_);
    const bool is_noticed =
        !reader.ok() || !(*reader)->is_finished() || !(*reader)->check_data_crc().ok();
    EXPECT_TRUE(is_noticed) << "byte " << at << " of " << file_.size();
  }
}

TEST_F(mcap_damage, flipped_bit_in_the_summary_falls_back_to_the_data) {
  const std::size_t summary = end_of(7) + 13;
  for (std::size_t at = summary; at < file_.size(); at += 13) {
    Bytes bytes = file_;
    bytes[at] ^= 0x01;
    auto reader = reopen(bytes);
    ASSERT_TRUE(reader) << at;
    EXPECT_FALSE(reader->is_finished()) << at;
    EXPECT_EQ(reader->dropped_bytes(), 0u);
    ASSERT_EQ(read_all(*reader).messages, written_) << at;
  }
}

TEST_F(mcap_damage, huge_lengths_are_not_believed) {
  // Length of the third chunk's record, then each length inside it.
  for (const std::size_t field : {1u, 25u, 37u, 45u}) {
    for (const std::uint64_t length :
         {~std::uint64_t{0}, std::uint64_t{1} << 40, std::uint64_t{1} << 31}) {
      Bytes bytes(file_.begin(), file_.begin() + static_cast<std::ptrdiff_t>(end_of(5)));
      std::memcpy(bytes.data() + chunks_[2].chunk_offset + field, &length, sizeof length);
      auto reader = reopen(bytes);
      ASSERT_TRUE(reader);
      const auto back = read_all(*reader).messages;
      EXPECT_GE(back.size(), written_before(chunks_[2].start_time).size());
      EXPECT_GT(reader->dropped_bytes(), 0u);
    }
  }
}

TEST_F(mcap_damage, a_small_chunk_that_unpacks_to_a_large_one_is_not_unpacked) {
  const Bytes zeros(100u << 20);
  Bytes bomb(ZSTD_compressBound(zeros.size()));
  bomb.resize(ZSTD_compress(bomb.data(), bomb.size(), zeros.data(), zeros.size(), 3));
  ASSERT_LT(bomb.size(), 20'000u);
  // It says what it is, which is over the limit, or says less.
  for (const std::uint64_t said : {std::uint64_t{zeros.size()}, std::uint64_t{1000}}) {
    Bytes bytes(file_.begin(), file_.begin() + static_cast<std::ptrdiff_t>(end_of(2)));
    const auto time = chunks_[2].end_time + 1;
    put_chunk(bytes, {time, time, said, 0, "zstd", bomb});
    auto reader = reopen(bytes);
    ASSERT_TRUE(reader);
    const auto back = read_all(*reader);
    EXPECT_EQ(back.messages, written_before(time)) << said;
  }
}

// A sound CRC over a summary that lies about offsets and lengths.
TEST_F(mcap_damage, lying_chunk_index) {
  const std::uint64_t huge = std::uint64_t{1} << 62;
  for (const int lie : {0, 1, 2, 3}) {
    Bytes bytes(file_.begin(), file_.begin() + static_cast<std::ptrdiff_t>(end_of(7)));
    put_data_end(bytes, 0);
    const std::size_t summary = bytes.size();
    put_channel(bytes, {1, 0, "/a", "", {}});
    McapChunkIndex index = chunks_[1];
    if (lie == 0) index.chunk_offset = huge;
    if (lie == 1) index.chunk_length = huge;
    if (lie == 2) index.chunk_offset += 3;
    if (lie == 3) index.chunk_length -= 3;
    put_chunk_index(bytes, index);
    ByteWriter writer(bytes);
    writer.put(Opcode::Footer), writer.put(std::uint64_t{20});
    writer.put(std::uint64_t{summary}), writer.put(std::uint64_t{0});
    writer.put(crc32(BytesView(bytes).subspan(summary)));
    writer.put_bytes(kMcapMagic);
    auto reader = reopen(bytes);
    ASSERT_TRUE(reader);
    const ReadBack back = read_all(*reader);
    if (lie < 2)
      EXPECT_EQ(back.messages, written_);  // refused, so rebuilt from the data
    else
      EXPECT_EQ(back.report.damaged_chunks, 1u);
  }
}

TEST_F(mcap_damage, random_flips_never_crash) {
  std::uint32_t state = 99;
  const auto next = [&state] { return state = state * 1664525 + 1013904223, state >> 8; };
  for (int round = 0; round < 400; ++round) {
    Bytes bytes = file_;
    for (std::uint32_t flips = 1 + next() % 4; flips > 0; --flips)
      bytes[next() % bytes.size()] ^= static_cast<std::uint8_t>(1u << next() % 8);
    save_file(path_, bytes);
    auto reader = McapReader::open(path_);
    if (!reader.ok()) continue;  // the first 41 bytes
    const ReadBack back = read_all(**reader);
    ASSERT_LE(back.messages.size(), written_.size());
    // Whatever is read is what was written: the CRC lets nothing else through.
    std::size_t at = 0;
    for (const Expected& m : back.messages) {
      while (at < written_.size() && !(written_[at] == m)) ++at;
      ASSERT_LT(at, written_.size()) << "round " << round;
    }
  }
}

TEST_F(mcap_damage, what_is_no_recording) {
  for (const Bytes& bytes : {Bytes{}, Bytes(1000), Bytes{0x89, 'M', 'C', 'A', 'P'}}) {
    save_file(path_, bytes);
    const auto reader = McapReader::open(path_);
    ASSERT_FALSE(reader.ok());
    EXPECT_NE(reader.error().message.find("not an MCAP recording"), std::string::npos);
  }
  EXPECT_FALSE(McapReader::open(folder_.file("none")).ok());
  EXPECT_FALSE(McapReader::open("/dev/null").ok());
}

TEST_F(mcap_damage, a_file_still_being_written_opens) {
  const auto path = folder_.file("growing.mcap");
  auto writer = create(path);
  const auto written = write_small(*writer, 600);
  auto reader = open(path);  // two chunks are on disk, one is open
  ASSERT_TRUE(reader);
  EXPECT_FALSE(reader->is_finished());
  EXPECT_EQ(reader->chunks().size(), 2u);
  EXPECT_EQ(read_all(*reader).messages.size(), 550u);
  ASSERT_TRUE(writer->close().ok());
  EXPECT_EQ(read_all(*open(path)).messages, written);
}

// The limit on file size stands in for a disk that fills up between two chunks.
TEST_F(mcap_damage, disk_full_later_leaves_whole_chunks) {
  const auto path = folder_.file("full.mcap");
  auto writer = create(path);
  const auto channel = writer->add_channel("/a", "", 0);
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit old{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &old), 0);
  rlimit limited = old;
  limited.rlim_cur = 20000;
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limited), 0);
  Status failure;
  std::uint64_t count = 0;
  std::uint32_t state = 5;
  while (failure.ok() && count < 100) {
    Bytes noise(900);
    for (auto& byte : noise)
      byte = static_cast<std::uint8_t>((state = state * 1664525 + 1013904223) >> 24);
    failure = writer->write(channel, kStart + count++ * 100 * kMillisecond, 1, noise);
  }
  const Status again = writer->write(channel, kStart + count * 100 * kMillisecond, 1, Bytes{1});
  const Status closed = writer->close();
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &old), 0);
  ASSERT_FALSE(failure.ok());
  EXPECT_FALSE(again.ok());
  EXPECT_FALSE(closed.ok());
  writer.reset();
  auto reader = open(path);
  ASSERT_TRUE(reader);
  EXPECT_GT(reader->chunks().size(), 3u);
  EXPECT_EQ(reader->dropped_bytes(), 0u);  // the torn chunk was cut off again
  EXPECT_TRUE(read_all(*reader).report.status().ok());
}

}  // namespace
}  // namespace trocar::journal
