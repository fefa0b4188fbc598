#include "client/replica/client_messages.h"

#include "common/wire/haptic_messages.h"
#include "proto/wire.pb.h"

namespace trocar::replica {

bool send_tool_sample(SessionSource& source, std::uint32_t tool, std::uint32_t sequence,
                      const tool::ToolSample& sample, std::uint64_t time_us) {
  proto::Envelope envelope;
  auto& message = *envelope.mutable_tool_sample();
  message.set_tool(tool);
  message.set_sequence(sequence);
  const Pose& pose = sample.world_from_tool;
  message.mutable_position_m()->set_x(pose.position.x);
  message.mutable_position_m()->set_y(pose.position.y);
  message.mutable_position_m()->set_z(pose.position.z);
  message.mutable_orientation()->set_x(pose.orientation.x);
  message.mutable_orientation()->set_y(pose.orientation.y);
  message.mutable_orientation()->set_z(pose.orientation.z);
  message.mutable_orientation()->set_w(pose.orientation.w);
  message.set_verb(static_cast<proto::Verb>(sample.verb));
  message.set_client_time_us(time_us);
  return source.send(envelope);
}

HapticNews haptic_news(const proto::Envelope& message) {
  HapticNews news;
  if (message.has_haptic_law()) {
    const auto law = wire::read(message.haptic_law());
    if (law)
      news.law = *law;
    else
      ++news.refused;
  }
  for (const auto& received : message.haptic_patches().patch()) {
    const auto patch = wire::read(received);
    if (patch)
      news.patches[patch->tool] = *patch;
    else
      ++news.refused;
  }
  return news;
}

bool ask_for_mark(SessionSource& source, bool is_return) {
  proto::Envelope envelope;
  envelope.mutable_mark_request()->set_action(is_return ? proto::MARK_RETURN : proto::MARK_SET);
  return source.send(envelope);
}

bool ask_for_ghost(SessionSource& source, bool is_wanted) {
  proto::Envelope envelope;
  envelope.mutable_ghost_request()->set_is_wanted(is_wanted);
  return source.send(envelope);
}

}  // namespace trocar::replica
