#include "tests/recording/forged_recording.h"

#include <gtest/gtest.h>

#include <map>

#include "common/journal/mcap_writer.h"

namespace trocar::recording::testing {

void forge(const std::string& from, const std::string& to, const KeepsMessage& keeps,
           const KeepsMetadata& keeps_metadata) {
  auto reader = journal::McapReader::open(from);
  ASSERT_TRUE(reader.ok());
  auto writer = journal::McapWriter::create(to, (*reader)->header());
  ASSERT_TRUE(writer.ok());
  for (auto metadata : (*reader)->metadata()) {
    if (!keeps_metadata(metadata)) continue;
    ASSERT_TRUE((*writer)->write_metadata(metadata).ok());
  }
  std::map<std::uint16_t, std::uint16_t> ids;
  for (const auto& [id, channel] : (*reader)->channels()) {
    const auto& schema = (*reader)->schemas().at(channel.schema_id);
    ids[id] =
        (*writer)->add_channel(channel.topic, channel.message_encoding,
                               (*writer)->add_schema(schema.name, schema.encoding, schema.data));
  }
  (*reader)->read({}, {}, [&](const journal::McapMessage& read) {
    auto message = read;
    if (!keeps((*reader)->channels().at(message.channel_id), message)) return true;
    EXPECT_TRUE((*writer)
                    ->write(ids.at(message.channel_id), message.log_time, message.publish_time,
                            message.data)
                    .ok());
    return true;
  });
  ASSERT_TRUE((*writer)->close().ok());
}

}  // namespace trocar::recording::testing
