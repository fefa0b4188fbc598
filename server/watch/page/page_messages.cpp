#include "server/watch/page/page_messages.h"

#include <cmath>

#include "proto/wire.pb.h"

namespace trocar::page {
namespace {

constexpr float kDeed_m = 1e-3f;  // tissue moves a tool that is still by less

}  // namespace

bool read_page_message(BytesView bytes, wire::Role role, proto::Envelope& message) {
  if (bytes.size() > wire::kMaxUpstreamBytes - wire::kHeaderBytes ||
      !wire::decode_envelope(bytes, message).ok())
    return false;
  switch (message.message_case()) {
    case proto::Envelope::kFrameAck:
    case proto::Envelope::kPing:
    case proto::Envelope::kKeyframeRequest:
    case proto::Envelope::kMarkRequest:
    case proto::Envelope::kPointRequest:
    case proto::Envelope::kStrokeRequest:
    case proto::Envelope::kTeachRequest:
    case proto::Envelope::kViewRequest:
    case proto::Envelope::kLessonRequest:
    case proto::Envelope::kBye:
      return true;
    case proto::Envelope::kToolSample:
    case proto::Envelope::kToolChange:
      return wire::rights_of(role).may_have_tools;
    default:
      return false;
  }
}

bool Deeds::note(const proto::Envelope& message) {
  switch (message.message_case()) {
    case proto::Envelope::kFrameAck:
    case proto::Envelope::kPing:
    case proto::Envelope::kKeyframeRequest:
    case proto::Envelope::kViewRequest:
      return false;
    case proto::Envelope::kToolSample:
      break;
    default:
      return true;
  }
  const auto& sample = message.tool_sample();
  const auto& at = sample.position_m();
  const std::array now{at.x(), at.y(), at.z(), static_cast<float>(sample.verb())};
  auto& last = last_.at(sample.tool() % kToolsPerHand);
  const bool has_moved = std::hypot(now[0] - last[0], now[1] - last[1], now[2] - last[2]) > kDeed_m;
  if (!has_moved && now[3] == last[3]) return false;
  last = now;
  return true;
}

}  // namespace trocar::page
