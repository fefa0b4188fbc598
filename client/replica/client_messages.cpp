#include "client/replica/client_messages.h"

#include "common/wire/hand_report_messages.h"
#include "common/wire/haptic_messages.h"
#include "common/wire/tool_shape.h"
#include "proto/wire.pb.h"

namespace trocar::replica {

void write_reading(const HandLineReading& reading, std::uint32_t sequence,
                   proto::Envelope& envelope) {
  auto& message = *envelope.mutable_tool_sample();
  message.set_tool(reading.tool);
  message.set_sequence(sequence);
  const Pose& pose = reading.sample.world_from_tool;
  message.mutable_position_m()->set_x(pose.position.x);
  message.mutable_position_m()->set_y(pose.position.y);
  message.mutable_position_m()->set_z(pose.position.z);
  message.mutable_orientation()->set_x(pose.orientation.x);
  message.mutable_orientation()->set_y(pose.orientation.y);
  message.mutable_orientation()->set_z(pose.orientation.z);
  message.mutable_orientation()->set_w(pose.orientation.w);
  message.set_verb(static_cast<proto::Verb>(reading.sample.verb));
  message.set_client_time_us(reading.time_us);
}

bool send_tool_sample(SessionSource& source, std::uint32_t tool, std::uint32_t sequence,
                      const tool::ToolSample& sample) {
  proto::Envelope envelope;
  write_reading({tool, sample, 0}, sequence, envelope);
  return source.send(envelope);
}

bool send_tool_change(SessionSource& source, std::uint32_t tool, const tool::ToolShape& shape) {
  proto::Envelope envelope;
  auto& change = *envelope.mutable_tool_change();
  change.set_tool(tool);
  wire::write(shape, *change.mutable_shape());
  return source.send(envelope);
}

void write_report(const wire::HandReport& report, proto::Envelope& envelope) {
  wire::write(report, *envelope.mutable_hand_report());
}

std::uint32_t pass_on(const proto::Envelope& message, HandLine& hands) {
  std::uint32_t refused = 0;
  const auto hand_on = [&](const auto& received) {
    const auto read = wire::read(received);
    if (read)
      hands.take(*read);
    else
      ++refused;
  };
  if (message.has_haptic_law()) hand_on(message.haptic_law());
  for (const auto& patch : message.haptic_patches().patch()) hand_on(patch);
  return refused;
}

bool send_lead_wish(SessionSource& source, const LeadWish& wish) {
  proto::Envelope envelope;
  auto& request = *envelope.mutable_teach_request();
  request.set_action(static_cast<proto::TeachAction>(wish.action));
  if (!wish.name.empty()) {
    request.set_participant(wish.participant.value);
    request.set_name(wish.name);
  }
  request.set_rate(wish.rate);
  if (wish.action == LeadAction::HandOver) {
    request.set_tool(static_cast<std::uint32_t>(wish.tool));
    request.set_receiver(wish.receiver.value);
    request.set_receiver_name(wish.receiver_name);
  }
  return source.send(envelope);
}

bool ask_for_mark(SessionSource& source, bool is_return, const std::string& name) {
  proto::Envelope envelope;
  envelope.mutable_mark_request()->set_action(is_return ? proto::MARK_RETURN : proto::MARK_SET);
  envelope.mutable_mark_request()->set_name(name);
  return source.send(envelope);
}

bool send_lesson_wish(SessionSource& source, LessonWish wish, std::uint32_t tool) {
  proto::Envelope envelope;
  auto& request = *envelope.mutable_lesson_request();
  request.set_action(static_cast<proto::LessonAction>(wish));
  request.set_tool(tool);
  return source.send(envelope);
}

bool send_view(SessionSource& source, const Vec3f& eye_m, const Vec3f& target_m) {
  const auto write_place = [](const Vec3f& from, proto::Vec3& to) {
    to.set_x(from.x);
    to.set_y(from.y);
    to.set_z(from.z);
  };
  proto::Envelope envelope;
  write_place(eye_m, *envelope.mutable_view_request()->mutable_eye_m());
  write_place(target_m, *envelope.mutable_view_request()->mutable_target_m());
  return source.send(envelope);
}

}  // namespace trocar::replica
