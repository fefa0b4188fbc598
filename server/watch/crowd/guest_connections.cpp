#include "server/watch/crowd/guest_connections.h"

#include <iterator>
#include <vector>

#include "proto/wire.pb.h"

namespace trocar::crowd {
namespace {

using net::ConnectionId;

// An Envelope that holds a GuestMessage begins with this: number of the field, and its kind.
constexpr std::uint32_t kTag = proto::Envelope::kGuestMessageFieldNumber << 3 | 2;
static_assert(kTag >= 1u << 7 && kTag < 1u << 14);

bool may_be_guest_message(BytesView message) {
  return message.size() > 2 && message[0] == ((kTag & 0x7f) | 0x80) && message[1] == kTag >> 7;
}

// Returns the GuestMessage around `frame`, which has its header; null: there is nothing in it.
wire::SharedBytes wrap(std::uint32_t number, const wire::SharedBytes& frame, bool is_last) {
  proto::Envelope envelope;
  auto& message = *envelope.mutable_guest_message();
  message.set_guest(number);
  message.set_is_last(is_last);
  if (frame) {
    const auto body = BytesView(*frame).subspan(wire::kHeaderBytes);
    message.set_envelope(body.data(), body.size());
  }
  return wire::encode_envelope(envelope);
}

wire::SharedBytes too_many() {
  proto::Envelope envelope;
  envelope.mutable_goodbye()->set_reason(proto::GOODBYE_FULL);
  envelope.mutable_goodbye()->set_text("too many watch over this connection");
  return wire::encode_envelope(envelope);
}

}  // namespace

// ---- to the network ----

bool GuestConnections::send(ConnectionId id, wire::SharedBytes frame) {
  const auto guest = guests_.find(id);
  if (guest == guests_.end()) return carriers_.send(id, std::move(frame));
  return carriers_.send(guest->second.carrier, wrap(guest->second.number, frame, false));
}

bool GuestConnections::has_datagrams(ConnectionId id) const {
  return carrier_of(id) == 0 && carriers_.has_datagrams(id);
}

bool GuestConnections::send_datagram(ConnectionId id, BytesView message) {
  return carrier_of(id) == 0 && carriers_.send_datagram(id, message);
}

std::size_t GuestConnections::outstanding_bytes(ConnectionId id) const {
  const auto carrier = carrier_of(id);
  return carriers_.outstanding_bytes(carrier == 0 ? id : carrier);
}

std::string GuestConnections::peer_address(ConnectionId id) const {
  const auto carrier = carrier_of(id);
  return carriers_.peer_address(carrier == 0 ? id : carrier);
}

ConnectionId GuestConnections::carrier_of(ConnectionId id) const {
  const auto guest = guests_.find(id);
  return guest == guests_.end() ? 0 : guest->second.carrier;
}

void GuestConnections::close_after_flush(ConnectionId id, wire::SharedBytes last_words) {
  if (carrier_of(id) == 0) return carriers_.close_after_flush(id, std::move(last_words));
  end(id, last_words);
}

void GuestConnections::close(ConnectionId id) {
  if (carrier_of(id) == 0) return carriers_.close(id);
  end(id, nullptr);
}

void GuestConnections::end(ConnectionId id, const wire::SharedBytes& last) {
  const Guest guest = guests_.at(id);
  forget(id);
  const auto words = wrap(guest.number, last, true);
  // Whoever cannot even be told that somebody has to go must not go on with his picture.
  const bool is_told = count_of(guest.carrier) > 0 && carriers_.send(guest.carrier, words);
  if (!is_told) carriers_.close_after_flush(guest.carrier, words);
}

void GuestConnections::forget(ConnectionId id) {
  const Guest guest = guests_.at(id);
  ids_.erase({guest.carrier, guest.number});
  guests_.erase(id);
}

std::size_t GuestConnections::count_of(ConnectionId carrier) const {
  return static_cast<std::size_t>(
      std::distance(ids_.lower_bound({carrier, 0}), ids_.lower_bound({carrier + 1, 0})));
}

// ---- from the network ----

void GuestConnections::on_message(ConnectionId id, BytesView bytes) {
  proto::Envelope envelope;
  const bool is_for_guest = may_be_guest_message(bytes) &&
                            wire::decode_envelope(bytes, envelope).ok() &&
                            envelope.has_guest_message();
  if (!is_for_guest) return above_->on_message(id, bytes);
  const auto& message = envelope.guest_message();
  const auto body = bytes_of(std::string_view(message.envelope()));
  const auto known = ids_.find({id, message.guest()});
  if (known == ids_.end() && body.empty()) return;  // it has ended here before
  if (known == ids_.end()) return admit(id, message.guest(), body);
  const auto guest = known->second;
  if (!body.empty()) above_->on_message(guest, body);
  if (!message.is_last() || !guests_.contains(guest)) return;
  forget(guest);
  above_->on_close(guest);
  if (count_of(id) == 0) carriers_.close_after_flush(id, nullptr);
}

void GuestConnections::admit(ConnectionId carrier, std::uint32_t number, BytesView envelope) {
  if (count_of(carrier) >= kMostGuests) {
    carriers_.send(carrier, wrap(number, too_many(), true));
    return;
  }
  const auto id = next_++;
  guests_[id] = {carrier, number};
  ids_[{carrier, number}] = id;
  above_->on_open(id);
  above_->on_message(id, envelope);
}

void GuestConnections::on_datagram(ConnectionId id, BytesView message) {
  above_->on_datagram(id, message);
}

void GuestConnections::on_fault(ConnectionId id, net::ConnectionFault fault) {
  above_->on_fault(id, fault);
}

void GuestConnections::on_close(ConnectionId id) {
  std::vector<ConnectionId> lost;
  for (auto next = ids_.lower_bound({id, 0}); next != ids_.end() && next->first.first == id; ++next)
    lost.push_back(next->second);
  for (const auto guest : lost) forget(guest);
  for (const auto guest : lost) above_->on_close(guest);
  above_->on_close(id);
}

}  // namespace trocar::crowd
