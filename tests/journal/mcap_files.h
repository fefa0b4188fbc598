#pragma once

// Files for the journal tests: a small recording, and what is read back of one.

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "common/journal/mcap_reader.h"
#include "common/journal/mcap_writer.h"
#include "tests/support/files.h"

namespace trocar::journal::testing {

inline constexpr std::uint64_t kStart = 1'700'000'000'000'000'000;  // ns
inline constexpr std::uint64_t kMillisecond = 1'000'000;

using trocar::testing::load_file;
using trocar::testing::save_file;
using trocar::testing::TemporaryFolder;

// Holds what a message must be when it is read back.
struct Expected {
  std::string topic;
  std::uint64_t log_time = 0;
  Bytes data;
  bool operator==(const Expected&) const = default;
};

// Returns message `i` of the small recording: compressible text and a counter.
inline Bytes payload_of(int i, std::size_t size) {
  Bytes data(size);
  for (std::size_t k = 0; k < size; ++k)
    data[k] = static_cast<std::uint8_t>(k % 7 + (k < 4 ? static_cast<std::size_t>(i) : 0));
  return data;
}

// 1 kHz on /a, every tenth also on /b, for `count` ms: 4 chunks a second.
inline std::vector<Expected> write_small(McapWriter& writer, int count) {
  const auto schema = writer.add_schema("Text", "text", Bytes{'s'});
  const auto a = writer.add_channel("/a", "text", schema);
  const auto b = writer.add_channel("/b", "text", 0, {{"unit", "N"}});
  std::vector<Expected> written;
  for (int i = 0; i < count; ++i) {
    const std::uint64_t time = kStart + static_cast<std::uint64_t>(i) * kMillisecond;
    for (const auto& [id, topic] : {std::pair{a, "/a"}, std::pair{b, "/b"}}) {
      if (id == b && i % 10 != 0) continue;
      const Bytes data = payload_of(i, 40);
      const Status status = writer.write(id, time, time + 5, data);
      EXPECT_TRUE(status.ok()) << status.error().message;
      written.push_back({topic, time, data});
    }
  }
  return written;
}

inline std::unique_ptr<McapWriter> create(const std::string& path,
                                          const McapWriterOptions& options = {}) {
  auto writer = McapWriter::create(path, {"test", "journal_test"}, options);
  EXPECT_TRUE(writer.ok()) << writer.error().message;
  return std::move(*writer);
}
inline std::unique_ptr<McapReader> open(const std::string& path) {
  auto reader = McapReader::open(path);
  EXPECT_TRUE(reader.ok()) << reader.error().message;
  return reader.ok() ? std::move(*reader) : nullptr;
}

struct ReadBack {
  std::vector<Expected> messages;
  ReadReport report;
};
inline ReadBack read_all(McapReader& reader, const TimeRange& range = {},
                         const ChannelFilter& filter = {}) {
  ReadBack back;
  back.report = reader.read(filter, range, [&](const McapMessage& m) {
    back.messages.push_back({reader.channels().at(m.channel_id).topic, m.log_time,
                             Bytes(m.data.begin(), m.data.end())});
    return true;
  });
  return back;
}

}  // namespace trocar::journal::testing
