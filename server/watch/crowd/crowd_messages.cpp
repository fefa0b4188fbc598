// The crowd's part about what its watchers say: who they are, what they have, and what they may not
// ask for.

#include "common/secure/digest.h"
#include "proto/wire.pb.h"
#include "server/session/participants/roster.h"
#include "server/session/replication/messages.h"
#include "server/watch/crowd/crowd_watcher.h"

namespace trocar::crowd {
namespace {

using replication::EndReason;

constexpr const char* kOnlyWatching =
    "you watch through a relay, which shows pictures and nothing else: join the server for more";

}  // namespace

std::optional<Crowd::Ending> Crowd::check_rate(Watcher& watcher, std::size_t bytes) {
  const auto now = options_.limits.clock_ns();
  const bool is_fine =
      watcher.messages.take(1, now) && watcher.bytes.take(static_cast<double>(bytes), now);
  if (is_fine) return std::nullopt;
  return Ending{EndReason::ProtocolError, "too many messages or bytes in a second"};
}

void Crowd::on_message(net::ConnectionId id, BytesView message) {
  const auto found = watchers_.find(id);
  if (found == watchers_.end()) return;
  auto& watcher = *found->second;
  if (const auto ending = handle_message(watcher, message)) end_watcher(watcher, *ending);
}

void Crowd::on_datagram(net::ConnectionId id, BytesView message) {
  const auto found = watchers_.find(id);
  if (found == watchers_.end() || !found->second->is_welcome) return;
  auto& watcher = *found->second;
  proto::Envelope envelope;
  auto ending = check_rate(watcher, message.size());
  if (!ending) {
    if (const auto decoded = wire::decode_envelope(message, envelope); !decoded)
      ending = Ending{EndReason::ProtocolError, decoded.error().message};
    else if (envelope.has_client_datagram())
      ending = handle_datagram(watcher, envelope.client_datagram());
  }
  if (ending) end_watcher(watcher, *ending);
}

std::optional<Crowd::Ending> Crowd::handle_datagram(Watcher& watcher,
                                                    const proto::ClientDatagram& datagram) {
  watcher.feed.hear(datagram.datagrams_received());
  if (datagram.sample_size() > 0) return Ending{EndReason::Role, kOnlyWatching};
  if (!datagram.has_ack()) return std::nullopt;
  return handle_ack(watcher, datagram.ack());
}

std::optional<Crowd::Ending> Crowd::handle_message(Watcher& watcher, BytesView bytes) {
  if (auto flood = check_rate(watcher, bytes.size())) return flood;
  proto::Envelope envelope;
  if (const auto decoded = wire::decode_envelope(bytes, envelope); !decoded)
    return Ending{EndReason::ProtocolError, decoded.error().message};
  if (watcher.is_carrier) return handle_carrier(watcher, envelope);
  if (watcher.carrier != 0)
    if (auto ending = check_guest(watcher)) return ending;
  if (!watcher.is_welcome && !envelope.has_hello())
    return Ending{EndReason::ProtocolError, "the first message must be Hello"};
  switch (envelope.message_case()) {
    case proto::Envelope::kHello:
      return admit(watcher, envelope.hello());
    case proto::Envelope::kFrameAck:
      if (watcher.carrier == 0) return handle_ack(watcher, envelope.frame_ack());
      note_answer(envelope.frame_ack());
      return std::nullopt;
    case proto::Envelope::kKeyframeRequest:
      if (watcher.carrier == 0) want_keyframe(watcher);
      return std::nullopt;
    case proto::Envelope::kPing:
      answer_ping(watcher, envelope.ping().client_time_us());
      return std::nullopt;
    case proto::Envelope::kBye: {
      const auto id = watcher.id;
      forget(watcher);
      connections_.close_after_flush(id, nullptr);
      return std::nullopt;
    }
    case proto::Envelope::kTeachRequest: {
      proto::Envelope answer;
      auto& event = *answer.mutable_teach_event();
      event.set_tick(copy_->tick());
      event.set_action(envelope.teach_request().action());
      event.set_text(kOnlyWatching);
      connections_.send(watcher.id, wire::encode_envelope(answer));
      return std::nullopt;
    }
    case proto::Envelope::kRelayReport:  // a relay of this relay: its watchers are its own business
    case proto::Envelope::MESSAGE_NOT_SET:
      return std::nullopt;
    default:
      return Ending{EndReason::Role, kOnlyWatching};
  }
}

std::optional<Crowd::Ending> Crowd::check_guest(Watcher& guest) {
  const auto found = watchers_.find(guest.carrier);
  const Ending closing{EndReason::ServerClosing, "the connection that carried you is closing"};
  if (found == watchers_.end()) return closing;
  auto& carrier = *found->second;
  if (carrier.is_welcome)
    return Ending{EndReason::ProtocolError, "GuestMessage: who watches himself carries no guests"};
  if (guest.is_welcome || carrier.messages.take(1, options_.limits.clock_ns())) return std::nullopt;
  end_watcher(carrier, {EndReason::ProtocolError, "GuestMessage: too many guests in a second"});
  return closing;
}

std::optional<Crowd::Ending> Crowd::handle_carrier(Watcher& carrier,
                                                   const proto::Envelope& message) {
  switch (message.message_case()) {
    case proto::Envelope::kFrameAck:
      return handle_ack(carrier, message.frame_ack());
    case proto::Envelope::kKeyframeRequest:
      want_keyframe(carrier);
      return std::nullopt;
    case proto::Envelope::kPing:
      answer_ping(carrier, message.ping().client_time_us());
      return std::nullopt;
    case proto::Envelope::MESSAGE_NOT_SET:
      return std::nullopt;
    default:
      return Ending{EndReason::ProtocolError,
                    "a connection that carries guests says nothing else for itself"};
  }
}

std::optional<Crowd::Ending> Crowd::check_code(const Watcher& watcher, BytesView secret) {
  const auto address = connections_.peer_address(watcher.id);
  const auto now = options_.limits.clock_ns();
  if (secret.empty())
    return Ending{EndReason::CodeWrong,
                  "join code: this session wants one, give --join CODE as the relay printed it"};
  if (const auto wait = limiter_.seconds_to_wait(address, now); wait > 0)
    return Ending{EndReason::TooManyTries,
                  "join code: too many wrong codes, try again in " + std::to_string(wait) + " s"};
  if (secure::equal_in_constant_time(secret, options_.secret)) return std::nullopt;
  ++counters_.wrong_codes;
  limiter_.record_wrong_try(address, now);
  return Ending{EndReason::CodeWrong,
                "join code: this relay knows no such code, check the last eight characters"};
}

std::optional<Crowd::Ending> Crowd::admit(Watcher& watcher, const proto::Hello& hello) {
  if (watcher.is_welcome) return Ending{EndReason::ProtocolError, "Hello: once is enough"};
  if (barrier_frame_) return Ending{EndReason::ServerClosing, "the session is ending"};
  auto reason = EndReason::ProtocolError;
  const auto request = replication::check_hello(hello, reason);
  if (!request) return Ending{reason, request.error().message};
  if (auto wrong = check_code(watcher, request->join_secret)) return wrong;
  if (request->role != participants::Role::Observer)
    return Ending{EndReason::Role, std::string("role: a relay lets observers in, and no ") +
                                       participants::name_of(request->role) +
                                       ": join the server itself"};
  if (!participants::is_valid_name(request->name))
    return Ending{EndReason::NameInvalid, participants::kNameRule};
  if (watchers_here_ >= options_.most_watchers)
    return Ending{EndReason::Full, "full: all " + std::to_string(options_.most_watchers) +
                                       " seats of this relay are taken"};
  if (request->acks_every_frame) watcher.feed.pace();
  proto::Envelope welcome;
  *welcome.mutable_welcome() = *welcome_;
  const Ending too_slow{EndReason::TooSlow, "the outbox is too small for the first messages"};
  watcher.is_welcome = true;
  ++watchers_here_;
  ++counters_.joins;
  if (!connections_.send(watcher.id, wire::encode_envelope(welcome))) return too_slow;
  auto* shown = &watcher;
  if (watcher.carrier != 0) {
    shown = watchers_.at(watcher.carrier).get();
    if (std::exchange(shown->is_carrier, true)) return std::nullopt;
    shown->feed.pace();
  }
  if (has_picture() && !show_all(*shown)) return too_slow;
  return std::nullopt;
}

std::optional<Crowd::Ending> Crowd::handle_ack(Watcher& watcher, const proto::FrameAck& ack) {
  if (!watcher.feed.was_given(ack.frame()))
    return Ending{EndReason::ProtocolError,
                  "FrameAck.frame: " + std::to_string(ack.frame()) + " was not given to you yet"};
  watcher.feed.acknowledge(*encoder_, ack.frame());
  watcher.fine_parts.on_acknowledged(ack.frame());
  if (watcher.is_welcome) note_answer(ack);
  return std::nullopt;
}

void Crowd::note_answer(const proto::FrameAck& ack) {
  if (!barrier_frame_ || ack.frame() != *barrier_frame_) return;
  ++counters_.answers;
  counters_.equal_answers += ack.surface_crc() == barrier_crc_;
}

void Crowd::want_keyframe(Watcher& watcher) {
  watcher.feed.want_keyframe();
  if (watcher.has_begun && has_picture() && watcher.feed.is_keyframe_due())
    give_frame(watcher, false);
}

// A pong that does not fit is left out: the watcher measures again in a moment.
void Crowd::answer_ping(Watcher& watcher, std::uint64_t client_time_us) {
  const auto now_us = options_.limits.clock_ns() / 1000;
  connections_.send(watcher.id, replication::encode_pong(client_time_us, copy_->tick(),
                                                         options_.server_time_us(now_us)));
}

}  // namespace trocar::crowd
