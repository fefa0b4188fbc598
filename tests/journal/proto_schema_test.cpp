#include "common/journal/proto_schema.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/dynamic_message.h>
#include <gtest/gtest.h>

#include "common/journal/session_topics.h"
#include "proto/journal.pb.h"

namespace trocar::journal {
namespace {

namespace pb = google::protobuf;

pb::FileDescriptorSet parsed(const Bytes& bytes) {
  pb::FileDescriptorSet set;
  EXPECT_TRUE(set.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
  return set;
}

// Builds each message type as another program would: from the schema alone, files in order.
TEST(proto_schema, every_topic_builds_alone_and_decodes) {
  for (int i = 0; i < kJournalTopicCount; ++i) {
    const pb::Descriptor& message = topic_message(static_cast<JournalTopic>(i));
    pb::DescriptorPool pool;
    const pb::FileDescriptorSet set = parsed(schema_bytes(message));
    for (const auto& file : set.file())
      ASSERT_NE(pool.BuildFile(file), nullptr) << message.full_name() << " " << file.name();
    const pb::Descriptor* built = pool.FindMessageTypeByName(schema_name(message));
    ASSERT_NE(built, nullptr) << message.full_name();
    EXPECT_EQ(built->field_count(), message.field_count());
  }
}

TEST(proto_schema, dependencies_come_first) {
  const auto set = parsed(schema_bytes(*proto::TickBatch::descriptor()));
  ASSERT_EQ(set.file_size(), 2);
  EXPECT_EQ(set.file(0).name(), "proto/wire.proto");
  EXPECT_EQ(set.file(1).name(), "proto/journal.proto");
}

TEST(proto_schema, holds_only_what_the_message_can_contain) {
  const auto set = parsed(schema_bytes(*proto::SurfaceFrame::descriptor()));
  ASSERT_EQ(set.file_size(), 1);
  ASSERT_EQ(set.file(0).message_type_size(), 1);
  EXPECT_EQ(set.file(0).message_type(0).name(), "SurfaceFrame");
  EXPECT_EQ(set.file(0).enum_type_size(), 0);
  EXPECT_LT(schema_bytes(*proto::SurfaceFrame::descriptor()).size(), 400u);
}

TEST(proto_schema, a_stranger_can_read_a_message) {
  pb::DescriptorPool pool;
  const pb::FileDescriptorSet set = parsed(schema_bytes(*proto::TickBatch::descriptor()));
  for (const auto& file : set.file()) pool.BuildFile(file);
  pb::DynamicMessageFactory factory(&pool);
  const std::unique_ptr<pb::Message> stranger(
      factory.GetPrototype(pool.FindMessageTypeByName("trocar.proto.TickBatch"))->New());
  proto::TickBatch batch;
  auto* record = batch.add_record();
  record->set_tick(17);
  record->add_sample()->set_verb(proto::VERB_GRASP);
  ASSERT_TRUE(stranger->ParseFromString(batch.SerializeAsString()));
  EXPECT_EQ(stranger->ShortDebugString(), batch.ShortDebugString());
}

}  // namespace
}  // namespace trocar::journal
