#pragma once

// Datagrams to and from the connections of one TcpServer, over one UDP socket and DTLS. A
// connection's key comes from its TLS session; a handshake with that key gives it a path. A later
// handshake with the same key, from wherever, replaces the path: so does a client whose address
// has changed.
//
// Bounds: nothing is kept for an address before it has shown a cookie; at most kMaxUnfinished
// handshakes run at a time, kMaxUnfinishedPerAddress of one address, each for kHandshakeDeadline:
// a newer one drives the oldest out. Nothing is queued: what the socket does not take is dropped
// and counted. Answers go from the address of this machine to which a handshake came.
//
// Thread: the one that runs the I/O context.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/ip/udp.hpp>
#include <chrono>
#include <functional>
#include <map>
#include <memory>

#include "common/base/result.h"
#include "common/secure/datagram_channel.h"
#include "server/session/net/connections.h"

namespace trocar::net {

struct DatagramCounters {
  std::uint64_t received = 0, sent = 0, dropped = 0;  // dropped: not taken by the socket
  std::uint64_t bytes_in = 0, bytes_out = 0;          // sealed
  std::uint64_t paths = 0;                            // handshakes that were finished
  std::uint64_t refused = 0;                          // unfinished, driven out by newer ones
};

class DatagramServer {
 public:
  using Deliver = std::function<void(ConnectionId, BytesView)>;
  static constexpr std::size_t kMaxUnfinished = 64, kMaxUnfinishedPerAddress = 32;
  static constexpr std::chrono::seconds kHandshakeDeadline{5};

  // Binds; ErrorCode::ResourceMissing when the port cannot be had.
  static Result<std::unique_ptr<DatagramServer>> open(asio::io_context& context,
                                                      const asio::ip::udp::endpoint& endpoint,
                                                      Deliver deliver);
  ~DatagramServer();

  void expect(ConnectionId id, const secure::DatagramKey& key);
  void forget(ConnectionId id);
  bool has_path(ConnectionId id) const;
  // False: there is no path, or the socket did not take it.
  bool send(ConnectionId id, BytesView message);
  // Repeats lost flights of handshakes and ends those that take too long; several times a second.
  void sweep();
  const DatagramCounters& counters() const { return counters_; }

 private:
  using Endpoint = asio::ip::udp::endpoint;
  using Clock = std::chrono::steady_clock;
  using KeyId = std::array<std::uint8_t, 16>;
  struct Path {
    std::unique_ptr<secure::DatagramChannel> channel;
    ConnectionId connection = 0;  // 0: its handshake is not finished
    asio::ip::address local;      // of this machine, to which it came
    Clock::time_point begin{};
  };

  DatagramServer(asio::io_context& context, Deliver deliver);
  asio::awaitable<void> receive(std::shared_ptr<bool> is_alive);
  void take(const Endpoint& peer, BytesView datagram);
  void greet(const Endpoint& peer, BytesView datagram);
  void settle(const Endpoint& peer, Path& path);
  void send_to(const Endpoint& peer, BytesView datagram);
  void make_room_for_newcomer(const Endpoint& peer);

  asio::ip::udp::socket socket_;
  const Deliver deliver_;
  std::map<KeyId, std::pair<ConnectionId, secure::Digest>> keys_;
  std::map<ConnectionId, KeyId> key_of_;
  std::map<ConnectionId, Endpoint> endpoint_of_;
  std::map<Endpoint, Path> paths_;
  secure::DatagramListener listener_;
  DatagramCounters counters_;
  asio::ip::address arrived_at_;  // of this machine, to which the newest datagram came
  std::shared_ptr<bool> is_alive_ = std::make_shared<bool>(true);
};

}  // namespace trocar::net
