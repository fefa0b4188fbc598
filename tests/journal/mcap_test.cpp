#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <filesystem>

#include "common/base/checksum.h"
#include "common/base/unfinished_file.h"
#include "tests/journal/mcap_files.h"

namespace trocar::journal {
namespace {

using namespace testing;  // NOLINT: the helpers of this folder

TEST(mcap, each_second_is_brought_to_the_disk_once) {
  const TemporaryFolder folder;
  std::uint64_t now = 0;
  std::vector<std::uint64_t> times;
  auto writer = create(folder.file("a.mcap"), {.sync_ns = 875 * kMillisecond,
                                               .clock_ns = [&] { return now; },
                                               .synchronise =
                                                   [&](int) {
                                                     times.push_back(now);
                                                     return 0;
                                                   }});
  const auto id = writer->add_channel("/a", "text", 0);
  constexpr std::uint64_t kSeconds = 10;
  for (std::uint64_t i = 0; i <= kSeconds * 1000; ++i) {
    now = i * kMillisecond;
    ASSERT_TRUE(writer->write(id, kStart + now, kStart + now, payload_of(7, 40)).ok());
  }
  EXPECT_EQ(writer->sync_count(), kSeconds);
  for (std::size_t i = 0; i < times.size(); ++i) EXPECT_EQ(times[i], (i + 1) * 1000 * kMillisecond);
  ASSERT_TRUE(writer->close().ok());
  EXPECT_EQ(writer->sync_count(), kSeconds + 1);
}

TEST(mcap, a_disk_that_cannot_keep_it_ends_the_recording) {
  const TemporaryFolder folder;
  std::uint64_t now = 0;
  auto writer = create(folder.file("a.mcap"), {.sync_ns = 1,
                                               .clock_ns = [&] { return ++now; },
                                               .synchronise =
                                                   [](int) {
                                                     errno = EIO;
                                                     return -1;
                                                   }});
  const auto id = writer->add_channel("/a", "text", 0);
  ASSERT_TRUE(writer->write(id, kStart, kStart, payload_of(0, 40)).ok());
  const Status status = writer->flush();
  ASSERT_FALSE(status.ok());
  EXPECT_NE(status.error().message.find("cannot synchronise"), std::string::npos);
  EXPECT_FALSE(writer->write(id, kStart, kStart, payload_of(0, 40)).ok());
}

TEST(mcap, round_trip_in_order) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.mcap");
  auto writer = create(path);
  const auto written = write_small(*writer, 1000);
  ASSERT_TRUE(writer->write_metadata({"note", {{"key", "value"}, {"other", ""}}}).ok());
  ASSERT_TRUE(writer->close().ok());

  auto reader = open(path);
  ASSERT_TRUE(reader);
  EXPECT_TRUE(reader->is_finished());
  EXPECT_EQ(reader->summary_text(), "finished recording: 1.0 s");
  EXPECT_EQ(reader->header().profile, "test");
  EXPECT_EQ(reader->chunks().size(), 4u);
  const ReadBack back = read_all(*reader);
  EXPECT_TRUE(back.report.status().ok());
  EXPECT_EQ(back.messages, written);

  ASSERT_EQ(reader->channels().size(), 2u);
  EXPECT_EQ(reader->channels().at(2).metadata, (StringMap{{"unit", "N"}}));
  ASSERT_EQ(reader->schemas().size(), 1u);
  EXPECT_EQ(reader->schemas().at(1).data, Bytes{'s'});
  ASSERT_EQ(reader->metadata().size(), 1u);
  EXPECT_EQ(reader->metadata()[0].entries.at("key"), "value");
  const McapStatistics& s = reader->statistics();
  EXPECT_EQ(s.message_count, written.size());
  EXPECT_EQ(s.chunk_count, 4u);
  EXPECT_EQ(s.schema_count, 1u);
  EXPECT_EQ(s.channel_count, 2u);
  EXPECT_EQ(s.metadata_count, 1u);
  EXPECT_EQ(s.start_time, kStart);
  EXPECT_EQ(s.end_time, kStart + 999 * kMillisecond);
  EXPECT_EQ(s.channel_message_counts,
            (std::map<std::uint16_t, std::uint64_t>{{1, 1000}, {2, 100}}));
}

TEST(mcap, exact_bytes_of_an_empty_recording) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.mcap");
  ASSERT_TRUE(create(path)->close().ok());
  const Bytes file = load_file(path);
  Bytes expected(kMcapMagic.begin(), kMcapMagic.end());
  ByteWriter out(expected);
  out.put(std::uint8_t{1}), out.put(std::uint64_t{24});  // Header
  out.put_string("test"), out.put_string("journal_test");
  const auto data_crc = crc32(expected);
  out.put(std::uint8_t{0x0f}), out.put(std::uint64_t{4}), out.put(data_crc);  // DataEnd
  const std::uint64_t summary = expected.size();
  out.put(std::uint8_t{0x0b}), out.put(std::uint64_t{46});  // Statistics, all zero
  expected.resize(expected.size() + 46);
  const std::uint64_t offsets = expected.size();
  out.put(std::uint8_t{0x0e}), out.put(std::uint64_t{17});  // SummaryOffset
  out.put(std::uint8_t{0x0b}), out.put(summary), out.put(std::uint64_t{55});
  out.put(std::uint8_t{0x02}), out.put(std::uint64_t{20});  // Footer
  out.put(summary), out.put(offsets);
  out.put(crc32(BytesView(expected).subspan(summary)));
  out.put_bytes(kMcapMagic);
  EXPECT_EQ(file, expected);
  auto reader = open(path);
  ASSERT_TRUE(reader);
  EXPECT_TRUE(reader->is_finished());
  EXPECT_TRUE(read_all(*reader).messages.empty());
}

TEST(mcap, seek_and_filter) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.mcap");
  auto writer = create(path);
  const auto written = write_small(*writer, 2000);
  ASSERT_TRUE(writer->close().ok());
  auto reader = open(path);
  ASSERT_TRUE(reader);
  const auto only_b = [](const McapChannel& channel) { return channel.topic == "/b"; };
  for (int from = 0; from < 2100; from += 137) {
    for (const int length : {0, 1, 249, 250, 900}) {
      const TimeRange range{kStart + static_cast<std::uint64_t>(from) * kMillisecond,
                            kStart + static_cast<std::uint64_t>(from + length) * kMillisecond};
      std::vector<Expected> all, of_b;
      for (const Expected& m : written) {
        if (m.log_time < range.from || m.log_time > range.to) continue;
        all.push_back(m);
        if (m.topic == "/b") of_b.push_back(m);
      }
      EXPECT_EQ(read_all(*reader, range).messages, all) << from << " " << length;
      EXPECT_EQ(read_all(*reader, range, only_b).messages, of_b) << from << " " << length;
    }
  }
}

TEST(mcap, visitor_may_stop) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.mcap");
  auto writer = create(path);
  write_small(*writer, 1000);
  ASSERT_TRUE(writer->close().ok());
  int seen = 0;
  const ReadReport report =
      open(path)->read({}, {}, [&](const McapMessage&) { return ++seen < 5; });
  EXPECT_EQ(seen, 5);
  EXPECT_EQ(report.messages, 5u);
}

TEST(mcap, last_before) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.mcap");
  auto writer = create(path);
  write_small(*writer, 1000);
  ASSERT_TRUE(writer->close().ok());
  auto reader = open(path);
  ASSERT_TRUE(reader);
  for (const std::uint64_t ms : {0u, 1u, 9u, 10u, 255u, 260u, 777u, 999u, 5000u}) {
    const auto found = reader->last_before("/b", kStart + ms * kMillisecond);
    ASSERT_TRUE(found.ok());
    ASSERT_TRUE(*found) << ms;
    const std::uint64_t expected = std::min<std::uint64_t>(ms, 999) / 10 * 10;
    EXPECT_EQ((*found)->log_time, kStart + expected * kMillisecond) << ms;
    EXPECT_EQ((*found)->data, payload_of(static_cast<int>(expected), 40));
  }
  EXPECT_EQ(reader->last_before("/b", kStart - 1).value(), nullptr);
  EXPECT_EQ(reader->last_before("/none", kStart).value(), nullptr);
}

TEST(mcap, chunk_policy) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.mcap");
  auto writer = create(path);
  const auto channel = writer->add_channel("/a", "", 0);
  const auto write = [&](std::uint64_t ms, std::size_t size) {
    ASSERT_TRUE(writer->write(channel, kStart + ms * kMillisecond, 1, Bytes(size)).ok());
  };
  write(0, 10), write(249, 10);                   // one chunk
  write(250, 10);                                 // 250 ms after the first: the next
  for (int i = 0; i < 5; ++i) write(251, 60000);  // over 256 KiB with the fifth
  write(252, 10);
  write(253, 65537);  // alone
  write(254, 65536);  // just not
  write(254, 10);
  ASSERT_TRUE(writer->flush().ok());
  ASSERT_TRUE(writer->flush().ok());  // never an empty chunk
  ASSERT_TRUE(writer->close().ok());
  auto reader = open(path);
  ASSERT_TRUE(reader);
  std::vector<std::size_t> per_chunk;
  for (const McapChunkIndex& index : reader->chunks()) {
    const auto ms = [](std::uint64_t time) { return (time - kStart) / kMillisecond; };
    per_chunk.push_back(ms(index.start_time) * 1000 + ms(index.end_time));
  }
  EXPECT_EQ(per_chunk, (std::vector<std::size_t>{249, 250251, 252252, 253253, 254254}));
  EXPECT_EQ(read_all(*reader).messages.size(), 12u);
}

TEST(mcap, messages_larger_than_a_chunk) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.mcap");
  auto writer = create(path);
  const auto channel = writer->add_channel("/big", "", 0);
  const Bytes big = payload_of(3, 3'000'000);
  for (std::uint64_t i = 0; i < 3; ++i)
    ASSERT_TRUE(writer->write(channel, kStart + i, kStart, big).ok());
  const Status refused = writer->write(channel, kStart + 9, kStart, Bytes(64u << 20));
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("/big"), std::string::npos);
  ASSERT_TRUE(writer->close().ok());  // one refused message is not the end
  auto reader = open(path);
  ASSERT_TRUE(reader);
  EXPECT_EQ(reader->chunks().size(), 3u);
  const auto back = read_all(*reader).messages;
  ASSERT_EQ(back.size(), 3u);
  EXPECT_EQ(back[2].data, big);
}

TEST(mcap, incompressible_chunks_are_stored_as_they_are) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.mcap");
  auto writer = create(path);
  const auto channel = writer->add_channel("/noise", "", 0);
  Bytes noise(4000);
  std::uint32_t state = 1;
  for (auto& byte : noise)
    byte = static_cast<std::uint8_t>((state = state * 1664525 + 1013904223) >> 24);
  ASSERT_TRUE(writer->write(channel, kStart, kStart, noise).ok());
  ASSERT_TRUE(writer->flush().ok());
  ASSERT_TRUE(writer->write(channel, kStart + 1, kStart, Bytes(4000)).ok());
  ASSERT_TRUE(writer->close().ok());
  auto reader = open(path);
  ASSERT_TRUE(reader);
  EXPECT_EQ(reader->chunks().at(0).compression, "");
  EXPECT_EQ(reader->chunks().at(1).compression, "zstd");
  EXPECT_EQ(read_all(*reader).messages.at(0).data, noise);
}

TEST(mcap, each_chunk_declares_what_it_uses_and_indexes_point_at_messages) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.mcap");
  McapWriterOptions options;
  options.compress = false;
  auto writer = create(path, options);
  write_small(*writer, 1000);
  ASSERT_TRUE(writer->close().ok());
  const Bytes file = load_file(path);
  const BytesView view(file);
  auto reader = open(path);
  ASSERT_TRUE(reader);
  for (const McapChunkIndex& index : reader->chunks()) {
    RecordWalker outer(
        view.subspan(index.chunk_offset, index.chunk_length + index.message_index_length));
    const auto chunk = parse_chunk(outer.next()->content);
    ASSERT_TRUE(chunk);
    std::vector<Opcode> front;
    RecordWalker inner(chunk->records);
    for (int i = 0; i < 5; ++i) front.push_back(inner.next()->opcode);
    EXPECT_EQ(front, (std::vector{Opcode::Schema, Opcode::Channel, Opcode::Message, Opcode::Channel,
                                  Opcode::Message}));
    std::size_t indexed = 0, index_records = 0;
    while (const auto record = outer.next()) {
      ASSERT_EQ(record->opcode, Opcode::MessageIndex);
      ++index_records;
      ByteReader entries(record->content);
      const auto channel = entries.read<std::uint16_t>();
      EXPECT_EQ(index.message_index_offsets.at(channel), index.chunk_offset + record->offset);
      entries.read<std::uint32_t>();
      while (entries.remaining() > 0) {
        const auto time = entries.read<std::uint64_t>();
        RecordWalker at(chunk->records.subspan(entries.read<std::uint64_t>()));
        const auto message = parse_message(at.next()->content);
        ASSERT_TRUE(message);
        EXPECT_EQ(message->channel_id, channel);
        EXPECT_EQ(message->log_time, time);
        ++indexed;
      }
    }
    EXPECT_TRUE(outer.ok());
    EXPECT_EQ(index_records, index.message_index_offsets.size());
    EXPECT_EQ(indexed, 275u);  // 250 on /a, 25 on /b
  }
}

TEST(mcap, overlapping_chunks_of_other_writers_come_in_order) {
  // Two chunks, times 10 30 50 and 20 40 60, put together from two files of ours.
  const TemporaryFolder folder;
  Bytes file;
  for (const std::uint64_t first : {10u, 20u}) {
    const auto path = folder.file(std::to_string(first));
    auto writer = create(path);
    const auto channel = writer->add_channel("/a", "", 0);
    for (std::uint64_t i = 0; i < 3; ++i)
      ASSERT_TRUE(writer->write(channel, first + i * 20, 1, Bytes{1}).ok());
    ASSERT_TRUE(writer->flush().ok());
    const Bytes part = load_file(path);
    constexpr std::size_t kFront = 8 + 9 + 24;
    file.insert(file.end(), part.begin() + (file.empty() ? 0 : kFront), part.end());
  }
  const auto path = folder.file("both.mcap");
  save_file(path, file);
  auto reader = open(path);
  ASSERT_TRUE(reader);
  std::vector<std::uint64_t> times;
  for (const Expected& m : read_all(*reader).messages) times.push_back(m.log_time);
  EXPECT_EQ(times, (std::vector<std::uint64_t>{10, 20, 30, 40, 50, 60}));
  EXPECT_EQ(reader->last_before("/a", 45).value()->log_time, 40u);
  EXPECT_EQ(reader->last_before("/a", 55).value()->log_time, 50u);
}

TEST(mcap, equal_input_gives_equal_files) {
  const TemporaryFolder folder;
  for (const char* name : {"a", "b"}) {
    auto writer = create(folder.file(name));
    write_small(*writer, 700);
    ASSERT_TRUE(writer->close().ok());
  }
  EXPECT_EQ(load_file(folder.file("a")), load_file(folder.file("b")));
}

TEST(mcap, never_overwrites_a_recording) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.mcap");
  save_file(path, Bytes{1, 2, 3});
  const auto writer = McapWriter::create(path, {});
  ASSERT_FALSE(writer.ok());
  EXPECT_EQ(writer.error().code, ErrorCode::BadFile);
  EXPECT_NE(writer.error().message.find("exists already"), std::string::npos);
  EXPECT_EQ(load_file(path), (Bytes{1, 2, 3}));
}

TEST(mcap, a_signal_leaves_no_half_of_a_file) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.mcap"), part = UnfinishedFile::name_for(path);
  const auto write_until = [&](int number) {
    remove_unfinished_files_on_signals();
    const auto writer = create(part);
    const UnfinishedFile file(part);
    raise(number);
  };
  for (const int number : {SIGTERM, SIGINT, SIGHUP}) {
    EXPECT_EXIT(write_until(number), ::testing::KilledBySignal(number), "");
    EXPECT_TRUE(std::filesystem::is_empty(folder.file("")));
  }
  // A file that has its name stays.
  {
    ASSERT_TRUE(create(part)->close().ok());
    UnfinishedFile file(part);
    ASSERT_TRUE(file.rename_to_new(path).ok());
  }
  EXPECT_TRUE(std::filesystem::exists(path));
  EXPECT_FALSE(std::filesystem::exists(part));
}

TEST(mcap, a_recording_is_no_business_of_everybody) {
  const TemporaryFolder folder;
  const auto before = ::umask(0);
  ASSERT_TRUE(create(folder.file("a.mcap"))->close().ok());
  ::umask(before);
  struct stat status {};
  ASSERT_EQ(::stat(folder.file("a.mcap").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 07777, 0640u);
}

TEST(mcap, full_disk_is_an_error_and_stays_one) {
  // /dev/full fails every write with "no space left".
  const auto at_once = McapWriter::create("/dev/full", {"test", "test"});
  ASSERT_FALSE(at_once.ok());
  EXPECT_NE(at_once.error().message.find("free some space"), std::string::npos);
  EXPECT_FALSE(McapWriter::create("/no/such/folder/a.mcap", {}).ok());
}

}  // namespace
}  // namespace trocar::journal
