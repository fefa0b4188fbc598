#pragma once

// The layers above see this of the network: messages as bytes, connections as numbers.
//
//   TcpServer --on_open/on_message/on_fault/on_close--> ConnectionHandler
//   TcpServer <--send/close_after_flush/close---------- whoever holds a Connections&
//
// Every call, in both directions, happens on the thread that runs the I/O context; nothing here
// locks. Handlers may call Connections from inside any callback, except that a connection is gone
// once on_close has been called for it: then every call for it does nothing.

#include <cstddef>
#include <cstdint>
#include <string>

#include "common/base/bytes.h"
#include "common/wire/framing.h"

namespace trocar::net {

// Never reused during the life of a server.
using ConnectionId = std::uint64_t;

// Why the transport gives up on a peer. After a fault nothing more is read; the handler says its
// last words and closes.
enum class ConnectionFault {
  TlsGreeting,     // this server speaks without TLS
  EmptyFrame,      // a frame of length zero
  OversizedFrame,  // a frame longer than the limit for messages from a client
  HelloTimeout,    // no message at all within the first deadline
  IdleTimeout,     // no message within the idle deadline
};
const char* describe(ConnectionFault fault);

class ConnectionHandler {
 public:
  virtual ~ConnectionHandler() = default;
  virtual void on_open(ConnectionId id) = 0;
  // `message` is the body of one frame, valid during the call.
  virtual void on_message(ConnectionId id, BytesView message) = 0;
  // `message` came as a datagram: unheard, late or out of order, but of this peer.
  virtual void on_datagram(ConnectionId id, BytesView message) = 0;
  virtual void on_fault(ConnectionId id, ConnectionFault fault) = 0;
  // This is called exactly once per connection, also after close() and close_after_flush().
  virtual void on_close(ConnectionId id) = 0;
};

class Connections {
 public:
  virtual ~Connections() = default;
  // Queues one framed message (header and body). False when the outbox has no room for it: then
  // nothing was queued. A message that is larger than the whole outbox is taken when it is empty.
  virtual bool send(ConnectionId id, wire::SharedBytes frame) = 0;
  // True once the peer has proved where its datagrams come from.
  virtual bool has_datagrams(ConnectionId id) const = 0;
  // Sends a message of at most secure::kDatagramMessageBytes that may get lost; false: it was
  // dropped here, or there is no path for it.
  virtual bool send_datagram(ConnectionId id, BytesView message) = 0;
  // Bytes queued and not yet taken by the kernel.
  virtual std::size_t outstanding_bytes(ConnectionId id) const = 0;
  // The peer's address without its port; empty if it is not known.
  virtual std::string peer_address(ConnectionId id) const = 0;
  // The connection that carries this one together with others; 0: it has its own.
  virtual ConnectionId carrier_of(ConnectionId) const { return 0; }
  // Queues `last_words` (may be null) whatever room there is, delivers nothing more from the peer,
  // and closes when all is sent and the peer has closed too, at the latest at the flush deadline.
  virtual void close_after_flush(ConnectionId id, wire::SharedBytes last_words) = 0;
  // Drops what is queued.
  virtual void close(ConnectionId id) = 0;
};

}  // namespace trocar::net
