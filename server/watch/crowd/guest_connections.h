#pragma once

// Connections, of which one may carry many guests (GuestMessage in proto/wire.proto). To the layer
// above a guest is a connection with a number of its own; carrier_of() tells which one carries it.
//
//   carriers --GuestMessage--> GuestConnections --on_open, on_message, on_close of the guest-->
//   above
//            <--GuestMessage--                  <--send, close to the guest--------------------
//
// Everything else passes through. A guest appears with its first message, and nothing is kept for
// one that says nothing. What is sent to a guest counts in the carrier's outbox. A guest that this
// side closes is gone at once, without on_close. A carrier is closed when it has no guest left, so
// that nobody holds a connection who was not let in.
//
// Bounds: kMostGuests of a carrier. Thread: the I/O thread.

#include <map>
#include <utility>

#include "server/session/net/connections.h"

namespace trocar::crowd {

class GuestConnections final : public net::Connections, public net::ConnectionHandler {
 public:
  static constexpr std::size_t kMostGuests = 256;

  // `carriers` outlives this.
  explicit GuestConnections(net::Connections& carriers) : carriers_(carriers) {}
  // Before the first call from below; it outlives all of them.
  void set_handler(net::ConnectionHandler& above) { above_ = &above; }

  bool send(net::ConnectionId id, wire::SharedBytes frame) override;
  bool has_datagrams(net::ConnectionId id) const override;
  bool send_datagram(net::ConnectionId id, BytesView message) override;
  std::size_t outstanding_bytes(net::ConnectionId id) const override;
  std::string peer_address(net::ConnectionId id) const override;
  net::ConnectionId carrier_of(net::ConnectionId id) const override;
  void close_after_flush(net::ConnectionId id, wire::SharedBytes last_words) override;
  void close(net::ConnectionId id) override;

  void on_open(net::ConnectionId id) override { above_->on_open(id); }
  void on_message(net::ConnectionId id, BytesView message) override;
  void on_datagram(net::ConnectionId id, BytesView message) override;
  void on_fault(net::ConnectionId id, net::ConnectionFault fault) override;
  void on_close(net::ConnectionId id) override;

 private:
  struct Guest {
    net::ConnectionId carrier = 0;
    std::uint32_t number = 0;
  };
  using Place = std::pair<net::ConnectionId, std::uint32_t>;  // carrier, number

  std::size_t count_of(net::ConnectionId carrier) const;
  void admit(net::ConnectionId carrier, std::uint32_t number, BytesView envelope);
  // After `last` has been said, if anything is to be.
  void end(net::ConnectionId id, const wire::SharedBytes& last);
  void forget(net::ConnectionId id);

  net::Connections& carriers_;
  net::ConnectionHandler* above_ = nullptr;
  std::map<net::ConnectionId, Guest> guests_;
  std::map<Place, net::ConnectionId> ids_;
  net::ConnectionId next_ = net::ConnectionId{1} << 62;  // none of a carrier gets there
};

}  // namespace trocar::crowd
