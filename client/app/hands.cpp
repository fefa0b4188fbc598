#include "client/app/hands.h"

#include "proto/wire.pb.h"

namespace trocar::app {

Hands Hands::mouse(const scene::ToolShape& shape) {
  Hands hands;
  hands.mouse_.emplace(shape);
  hands.mouse_shape_ = shape;
  return hands;
}

Hands Hands::scripted(scene::Script script) {
  Hands hands;
  for (const auto& tool : script.tools) hands.script_shapes_.push_back(tool.shape);
  hands.script_ = std::move(script);
  return hands;
}

std::vector<scene::ToolShape> Hands::shapes() const {
  return mouse_ ? std::vector<scene::ToolShape>{mouse_shape_} : script_shapes_;
}

void Hands::send(replica::SessionSource& source, std::uint32_t tool,
                 const scene::ToolSample& sample) {
  proto::Envelope envelope;
  auto& message = *envelope.mutable_tool_sample();
  message.set_tool(tool);
  message.set_sequence(++sequence_);
  const Pose& pose = sample.world_from_tool;
  message.mutable_position_m()->set_x(pose.position.x);
  message.mutable_position_m()->set_y(pose.position.y);
  message.mutable_position_m()->set_z(pose.position.z);
  message.mutable_orientation()->set_x(pose.orientation.x);
  message.mutable_orientation()->set_y(pose.orientation.y);
  message.mutable_orientation()->set_z(pose.orientation.z);
  message.mutable_orientation()->set_w(pose.orientation.w);
  message.set_verb(static_cast<proto::Verb>(sample.verb));
  source.send(envelope);  // dropped when the queue is full: the next sample says more
}

Status Hands::send_due(const replica::Replica& replica, replica::SessionSource& source,
                       std::uint64_t now_ns) {
  if (replica.newest() == nullptr || source.state() != replica::SourceState::Live) return {};
  if (mouse_)
    if (const auto sample = mouse_->take_due(now_ns)) send(source, 0, *sample);
  if (script_) {
    auto hand = device::ScriptHand::make(std::move(*script_), replica.topology().rest_positions,
                                         replica.topology().triangles);
    script_.reset();
    if (!hand) return hand.error();
    script_hand_ = std::move(*hand);
    script_start_ns_ = now_ns;
  }
  if (script_hand_ && now_ns - script_sent_ns_ >= device::kSampleIntervalNs) {
    script_sent_ns_ = now_ns;
    const double seconds = static_cast<double>(now_ns - script_start_ns_) * 1e-9;
    for (std::size_t tool = 0; tool < script_hand_->tool_count(); ++tool)
      send(source, static_cast<std::uint32_t>(tool), script_hand_->sample(tool, seconds));
  }
  return {};
}

}  // namespace trocar::app
