#pragma once

// TCP listener and its connections, with TLS or without. Moves framed messages and knows nothing
// about what they say. With TLS the handler hears of a connection once its handshake is done.
//
// Bounds, so that no peer can take memory or time from the others:
//   - connections: `max_connections`, and of these newcomers, who have sent no message yet:
//     `max_newcomers` in all and `max_newcomers_per_address`. acceptor.h says who is closed for one
//     more. Handshake and first message share one deadline;
//   - inbound: one frame per connection is buffered, at most `max_message_bytes`;
//   - outbound: `outbox_bytes` per connection; send() says no when full, the caller decides;
//   - time: a first message within `hello_deadline`, then one at least every `idle_deadline`;
//     a closing connection has `flush_deadline` to take its last bytes.
// The kernel's send buffer is fixed at `send_buffer_bytes`: left to grow by itself it would hold
// seconds of stale frames for a slow reader, unseen by outstanding_bytes().
//
// Thread: all calls and callbacks on the one thread that runs the I/O context, which outlives this.

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "common/base/asio.h"
#include "common/base/ids.h"
#include "common/base/result.h"
#include "common/secure/tls.h"
#include "server/session/net/connections.h"
#include "server/session/net/datagram_server.h"

namespace boost::asio {
class io_context;
}

namespace trocar::net {

struct TcpServerOptions {
  std::string address = "127.0.0.1";
  std::uint16_t port = 7690;                    // 0: any free port
  int max_connections = kMaxParticipants + 12;  // some room to tell the next one "full"
  int max_newcomers = 48;
  int max_newcomers_per_address = 32;  // a class may sit behind one address
  std::uint32_t max_message_bytes = wire::kMaxUpstreamBytes;
  std::size_t outbox_bytes = 1024 * 1024;
  int send_buffer_bytes = 128 * 1024;
  std::chrono::milliseconds hello_deadline{5000};
  std::chrono::milliseconds idle_deadline{10000};
  std::chrono::milliseconds flush_deadline{2000};
  secure::TlsContext tls;         // null: without TLS
  wire::SharedBytes plain_reply;  // with TLS: one frame for who begins without; null: none
  bool has_datagrams = true;      // with TLS: at the same address and port
};

struct TcpCounters {
  std::uint64_t accepted = 0;
  std::uint64_t rejected_full = 0;      // closed at once: max_connections reached
  std::uint64_t newcomers_dropped = 0;  // closed for others: too many who have said nothing yet
  std::uint64_t handshakes_failed = 0;  // closed before TLS was there
  std::uint64_t faults = 0;
  std::uint64_t messages_in = 0, bytes_in = 0, bytes_out = 0;
};

// Runs handlers and coroutines until the context is stopped or has nothing left to do. What one of
// them throws ends that: an error says what it was, and the context is not run again.
Status run(asio::io_context& context);

class TcpServer final : public Connections {
 public:
  // Binds and listens; ErrorCode::ResourceMissing when the address or port cannot be had.
  static Result<std::unique_ptr<TcpServer>> listen(asio::io_context& context,
                                                   const TcpServerOptions& options);
  // Closes everything; no callback after this.
  ~TcpServer() override;

  // Starts accepting. `handler` outlives this object.
  void start(ConnectionHandler& handler);
  // No further connections; those that exist stay.
  void stop_accepting();

  std::uint16_t port() const;
  std::size_t connection_count() const;
  TcpCounters counters() const;
  bool has_datagrams() const;
  // All zero without datagrams.
  DatagramCounters datagram_counters() const;

  bool send(ConnectionId id, wire::SharedBytes frame) override;
  bool has_datagrams(ConnectionId id) const override;
  bool send_datagram(ConnectionId id, BytesView message) override;
  std::size_t outstanding_bytes(ConnectionId id) const override;
  std::string peer_address(ConnectionId id) const override;
  void close_after_flush(ConnectionId id, wire::SharedBytes last_words) override;
  void close(ConnectionId id) override;

 private:
  class Core;
  explicit TcpServer(std::shared_ptr<Core> core);

  std::shared_ptr<Core> core_;  // shared with the coroutines, which may outlive this object
};

}  // namespace trocar::net
