#include "common/wire/session_messages.h"

#include <array>

#include "common/base/version.h"
#include "common/wire/tool_shape.h"
#include "proto/wire.pb.h"

namespace trocar::wire {

static_assert(static_cast<int>(EndReason::Timeout) == proto::GOODBYE_TIMEOUT);
static_assert(static_cast<int>(EndReason::NameInvalid) == proto::GOODBYE_NAME_INVALID);
static_assert(static_cast<int>(EndReason::Closed) == proto::GOODBYE_CLOSED);
static_assert(kEndReasonCount == proto::GoodbyeReason_ARRAYSIZE);

const char* name_of(EndReason reason) {
  static constexpr std::array<const char*, kEndReasonCount> kNames{
      "unspecified",  "server-closing", "protocol-error", "version",        "full",
      "name-taken",   "role",           "too-slow",       "timeout",        "code-wrong",
      "code-expired", "code-used-up",   "code-revoked",   "too-many-tries", "code-role",
      "name-invalid", "put-out",        "closed"};
  return kNames[static_cast<std::size_t>(reason)];
}

SharedBytes encode_hello(const Hello& hello) {
  proto::Envelope envelope;
  auto& message = *envelope.mutable_hello();
  message.set_protocol_major(kProtocolMajor);
  message.set_protocol_minor(kProtocolMinor);
  message.set_name(hello.name);
  message.set_role(static_cast<proto::Role>(hello.role));
  message.set_join_secret(hello.join_secret.data(), hello.join_secret.size());
  message.set_acks_every_frame(hello.acks_every_frame);
  message.set_can_return(hello.can_return);
  message.set_return_token(hello.return_token.data(), hello.return_token.size());
  message.set_relays(hello.relays);
  for (const auto& shape : hello.tools) write(shape, *message.add_tool());
  return encode_envelope(envelope);
}

SharedBytes encode_goodbye(EndReason reason, const std::string& text) {
  proto::Envelope envelope;
  envelope.mutable_goodbye()->set_reason(static_cast<proto::GoodbyeReason>(reason));
  envelope.mutable_goodbye()->set_text(text);
  return encode_envelope(envelope);
}

SharedBytes encode_bye(const std::string& reason) {
  proto::Envelope envelope;
  envelope.mutable_bye()->set_reason(reason);
  return encode_envelope(envelope);
}

SharedBytes encode_pong(std::uint64_t client_time_us, Tick tick, std::uint64_t server_time_us) {
  proto::Envelope envelope;
  envelope.mutable_pong()->set_client_time_us(client_time_us);
  envelope.mutable_pong()->set_tick(tick);
  envelope.mutable_pong()->set_server_time_us(server_time_us);
  return encode_envelope(envelope);
}

}  // namespace trocar::wire
