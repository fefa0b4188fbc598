// The replicator's part about guests: people who watch over a connection that carries many. Each is
// let in, listed and put out as anybody; frames, events and lists go to the carrier, once. Those
// who watch through a relay are known by their number alone.

#include "proto/wire.pb.h"
#include "server/session/replication/messages.h"
#include "server/session/replication/replicator_client.h"

namespace trocar::replication {

std::optional<Ending> Replicator::check_guest(Client& guest, const proto::Envelope& message) {
  const auto found = clients_.find(guest.carrier);
  if (found == clients_.end())
    return Ending{EndReason::ServerClosing, "the connection that carried you is closing"};
  auto& carrier = *found->second;
  const auto refusal = [](std::string text) {
    return Ending{EndReason::ProtocolError, std::move(text)};
  };
  if (carrier.participant) return refusal("GuestMessage: who takes part carries no guests");
  // Each guest begins with an allowance of its own, so that the number of guests needs one.
  if (!guest.participant && !carrier.messages.take(1, options_.clock_ns())) {
    end_session(carrier, refusal("GuestMessage: too many guests in a second"));
    return Ending{EndReason::ServerClosing, "the connection that carried you is closing"};
  }
  if (message.has_hello() && (message.hello().role() == proto::ROLE_SURGEON ||
                              message.hello().role() == proto::ROLE_ASSISTANT))
    return Ending{EndReason::Role, "GuestMessage: who has tools needs an own connection"};
  return std::nullopt;
}

std::optional<Ending> Replicator::welcome_guest(Client& guest) {
  auto& carrier = *clients_.at(guest.carrier);
  if (carrier.is_carrier) return std::nullopt;
  carrier.is_carrier = true;
  carrier.feed.pace();
  return show_all(carrier);
}

std::optional<Ending> Replicator::handle_relay_report(Client& client,
                                                      const proto::RelayReport& report) {
  if (client.participant->role != participants::Role::Observer)
    return Ending{EndReason::Role, std::string("RelayReport: an observer may relay, and no ") +
                                       participants::name_of(client.participant->role)};
  if (report.watchers() > wire::kMostRelayed)
    return Ending{EndReason::ProtocolError,
                  "RelayReport.watchers: " + std::to_string(report.watchers()) + ", at most " +
                      std::to_string(wire::kMostRelayed)};
  if (!client.reports.take(1, options_.clock_ns()))
    return Ending{EndReason::ProtocolError, "RelayReport: more than one in a second"};
  roster_.set_relayed(client.participant->slot, report.watchers());
  session_.is_told = false;  // the recording does not need it
  return std::nullopt;
}

std::optional<Ending> Replicator::handle_carrier(Client& carrier, const proto::Envelope& message) {
  switch (message.message_case()) {
    case proto::Envelope::kFrameAck:
      return handle_ack(carrier, message.frame_ack());
    case proto::Envelope::kKeyframeRequest:
      carrier.feed.want_keyframe();
      if (encoder_.current() && carrier.feed.is_keyframe_due()) give_frame(carrier, false);
      return std::nullopt;
    case proto::Envelope::kPing:
      send(carrier,
           encode_pong(message.ping().client_time_us(), newest_tick(), options_.clock_ns() / 1000));
      return std::nullopt;
    case proto::Envelope::MESSAGE_NOT_SET:
      return std::nullopt;  // a message of a newer minor version
    default:
      return Ending{EndReason::ProtocolError,
                    "a connection that carries guests says nothing else for itself"};
  }
}

}  // namespace trocar::replication
