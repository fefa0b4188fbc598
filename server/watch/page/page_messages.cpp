#include "server/watch/page/page_messages.h"

#include "proto/wire.pb.h"

namespace trocar::page {

bool read_page_message(BytesView bytes, proto::Envelope& message) {
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
    default:
      return false;
  }
}

wire::SharedBytes encode_goodbye(int reason, const std::string& text) {
  proto::Envelope envelope;
  envelope.mutable_goodbye()->set_reason(static_cast<proto::GoodbyeReason>(reason));
  envelope.mutable_goodbye()->set_text(text);
  return wire::encode_envelope(envelope);
}

wire::SharedBytes encode_bye(const std::string& reason) {
  proto::Envelope envelope;
  envelope.mutable_bye()->set_reason(reason);
  return wire::encode_envelope(envelope);
}

wire::SharedBytes encode_pong(std::uint64_t client_time_us, std::uint64_t tick,
                              std::uint64_t server_time_us) {
  proto::Envelope envelope;
  auto& pong = *envelope.mutable_pong();
  pong.set_client_time_us(client_time_us);
  pong.set_tick(tick);
  pong.set_server_time_us(server_time_us);
  return wire::encode_envelope(envelope);
}

}  // namespace trocar::page
