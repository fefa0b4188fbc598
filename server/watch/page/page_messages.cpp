#include "server/watch/page/page_messages.h"

#include "proto/wire.pb.h"

namespace trocar::page {

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

}  // namespace trocar::page
