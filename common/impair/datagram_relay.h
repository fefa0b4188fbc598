#pragma once

// Datagrams through the proxy. Each peer, an address and port on the client side, gets a socket of
// its own towards the server, so that the server tells peers apart, and a line in each direction.
//
// Bounds: `most_peers` peers, a datagram of one more is counted and thrown away; a peer that is
// silent in both directions for `idle` is forgotten.
// Thread: the one that runs the I/O context.

#include <map>
#include <memory>

#include "common/impair/datagram_line.h"
#include "common/impair/network.h"

namespace trocar::impair {

class DatagramRelay : public std::enable_shared_from_this<DatagramRelay> {
 public:
  // `clients` is bound.
  DatagramRelay(std::shared_ptr<Network> network, asio::ip::udp::socket clients);

  void start();
  void close();

 private:
  struct Peer;

  asio::awaitable<void> receive_from_clients();
  asio::awaitable<void> receive_from_server(std::shared_ptr<Peer> peer);
  asio::awaitable<void> deliver(std::shared_ptr<Peer> peer, bool is_up);
  asio::awaitable<void> forget_idle_peers();
  std::shared_ptr<Peer> find_or_admit(const asio::ip::udp::endpoint& client);
  void forget(Peer& peer);
  void run(asio::awaitable<void> work);

  const std::shared_ptr<Network> network_;
  asio::ip::udp::socket clients_;
  asio::steady_timer sweep_, retry_;
  std::map<asio::ip::udp::endpoint, std::shared_ptr<Peer>> peers_;
  bool is_closed_ = false;
};

}  // namespace trocar::impair
