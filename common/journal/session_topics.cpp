#include "common/journal/session_topics.h"

#include <array>

#include "proto/journal.pb.h"
#include "proto/organ.pb.h"
#include "proto/wire.pb.h"

namespace trocar::journal {
namespace {

struct TopicEntry {
  const char* name;
  const google::protobuf::Descriptor* message;
};
const TopicEntry& entry_of(JournalTopic topic) {
  static const std::array<TopicEntry, kJournalTopicCount> kEntries{{
      {"/organ", proto::Organ::descriptor()},
      {"/world/snapshot", proto::WorldSnapshot::descriptor()},
      {"/tick_batch", proto::TickBatch::descriptor()},
      {"/surface/key", proto::SurfaceFrame::descriptor()},
      {"/surface/delta", proto::SurfaceFrame::descriptor()},
      {"/topology", proto::SurfaceTopology::descriptor()},
      {"/participants", proto::Participants::descriptor()},
      {"/claims", proto::ClaimLog::descriptor()},
      {"/frame_state", proto::FrameState::descriptor()},
      {"/gap", proto::JournalGap::descriptor()},
      {"/topology/change", proto::SurfaceChange::descriptor()},
      {"/loads", proto::ExternalLoads::descriptor()},
      {"/hands", proto::HandLog::descriptor()},
      {"/lesson", proto::LessonRecord::descriptor()},
      {"/drawing", proto::Drawing::descriptor()},
      {"/overview", proto::Overview::descriptor()},
      {"/bleeding", proto::BleedingRules::descriptor()},
      {"/threads", proto::ThreadRules::descriptor()},
  }};
  return kEntries[static_cast<std::size_t>(topic)];
}

}  // namespace

const char* topic_name(JournalTopic topic) {
  return entry_of(topic).name;
}
std::optional<JournalTopic> topic_of(std::string_view name) {
  for (int i = 0; i < kJournalTopicCount; ++i)
    if (name == topic_name(static_cast<JournalTopic>(i))) return static_cast<JournalTopic>(i);
  return std::nullopt;
}
const google::protobuf::Descriptor& topic_message(JournalTopic topic) {
  return *entry_of(topic).message;
}

}  // namespace trocar::journal
