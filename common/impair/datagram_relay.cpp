#include "common/impair/datagram_relay.h"

#include <algorithm>
#include <boost/asio/buffer.hpp>

#include "common/base/spawn.h"

namespace trocar::impair {
namespace {

using asio::ip::udp;
constexpr std::size_t kMostDatagram = 65'536;  // more than one can be
constexpr std::chrono::milliseconds kLongestSweep{1000};
// An error that stays, such as a full table: wait instead of spinning.
constexpr std::chrono::milliseconds kErrorPause{10};

}  // namespace

struct DatagramRelay::Peer {
  Peer(Network& network, udp::endpoint address, udp::socket socket, std::uint64_t number)
      : client(std::move(address)),
        server(std::move(socket)),
        up(network.up, network.options.blocked,
           seed_of(network.options.seed, Flow::DatagramsUp, number)),
        down(network.down, network.options.blocked,
             seed_of(network.options.seed, Flow::DatagramsDown, number)),
        up_arrived(server.get_executor()),
        down_arrived(server.get_executor()),
        last_heard(network.now()) {}

  const udp::endpoint client;
  udp::socket server;
  DatagramLine up, down;
  asio::steady_timer up_arrived, down_arrived;
  Time last_heard;
  bool is_forgotten = false;
};

DatagramRelay::DatagramRelay(std::shared_ptr<Network> network, udp::socket clients)
    : network_(std::move(network)),
      clients_(std::move(clients)),
      sweep_(clients_.get_executor()),
      retry_(clients_.get_executor()) {}

void DatagramRelay::run(asio::awaitable<void> work) {
  spawn(clients_.get_executor(), std::move(work),
        [self = shared_from_this()](std::exception_ptr failure) { rethrow(failure); });
}

void DatagramRelay::start() {
  boost::system::error_code ignored;
  clients_.non_blocking(true, ignored);
  run(receive_from_clients());
  run(forget_idle_peers());
}

void DatagramRelay::close() {
  is_closed_ = true;
  boost::system::error_code ignored;
  clients_.close(ignored);
  sweep_.cancel();
  retry_.cancel();
  const auto all = std::move(peers_);
  peers_.clear();
  for (const auto& [client, peer] : all) forget(*peer);
}

void DatagramRelay::forget(Peer& peer) {
  peer.is_forgotten = true;
  boost::system::error_code ignored;
  peer.server.close(ignored);
  peer.up_arrived.cancel();
  peer.down_arrived.cancel();
}

std::shared_ptr<DatagramRelay::Peer> DatagramRelay::find_or_admit(const udp::endpoint& client) {
  if (const auto found = peers_.find(client); found != peers_.end()) return found->second;
  if (peers_.size() >= network_->options.most_peers) return nullptr;
  boost::system::error_code error;
  udp::socket socket(clients_.get_executor());
  socket.open(network_->datagram_server.protocol(), error);
  if (!error) socket.connect(network_->datagram_server, error);
  if (!error) socket.non_blocking(true, error);
  if (error) return nullptr;
  auto peer = std::make_shared<Peer>(*network_, client, std::move(socket), network_->peers++);
  peers_.emplace(client, peer);
  run(receive_from_server(peer));
  run(deliver(peer, true));
  run(deliver(peer, false));
  return peer;
}

asio::awaitable<void> DatagramRelay::receive_from_clients() {
  Bytes datagram(kMostDatagram);
  udp::endpoint client;
  while (!is_closed_) {
    const auto [error, count] =
        co_await clients_.async_receive_from(asio::buffer(datagram), client, kNoThrow);
    if (is_closed_) break;
    if (error) {
      retry_.expires_after(kErrorPause);
      co_await retry_.async_wait(kNoThrow);
      continue;
    }
    const auto peer = find_or_admit(client);
    if (!peer) {
      ++network_->datagrams_refused;
      continue;
    }
    peer->last_heard = network_->now();
    peer->up.push(peer->last_heard, BytesView(datagram).first(count));
    peer->up_arrived.cancel();
  }
}

asio::awaitable<void> DatagramRelay::receive_from_server(std::shared_ptr<Peer> peer) {
  Bytes datagram(kMostDatagram);
  asio::steady_timer pause(peer->server.get_executor());
  while (!peer->is_forgotten) {
    const auto [error, count] =
        co_await peer->server.async_receive(asio::buffer(datagram), kNoThrow);
    if (peer->is_forgotten) break;
    if (error) {  // nobody listens there, perhaps not yet
      pause.expires_after(kErrorPause);
      co_await pause.async_wait(kNoThrow);
      continue;
    }
    peer->last_heard = network_->now();
    peer->down.push(peer->last_heard, BytesView(datagram).first(count));
    peer->down_arrived.cancel();
  }
}

asio::awaitable<void> DatagramRelay::deliver(std::shared_ptr<Peer> peer, bool is_up) {
  auto& line = is_up ? peer->up : peer->down;
  auto& arrived = is_up ? peer->up_arrived : peer->down_arrived;
  boost::system::error_code ignored;  // a datagram that cannot be sent is one more that is lost
  while (!peer->is_forgotten) {
    const Time now = network_->now();
    if (line.next() > now) {
      arrived.expires_at(network_->due(line.next()));
      co_await arrived.async_wait(kNoThrow);
      continue;
    }
    const Bytes datagram = line.pop(now);
    if (is_up)
      peer->server.send(asio::buffer(datagram), 0, ignored);
    else
      clients_.send_to(asio::buffer(datagram), peer->client, 0, ignored);
  }
}

asio::awaitable<void> DatagramRelay::forget_idle_peers() {
  const auto& idle = network_->options.idle;
  while (!is_closed_) {
    sweep_.expires_after(std::min(kLongestSweep, idle));
    co_await sweep_.async_wait(kNoThrow);
    if (is_closed_) break;
    const Time now = network_->now();
    std::erase_if(peers_, [&](const auto& entry) {
      if (now - entry.second->last_heard < idle) return false;
      forget(*entry.second);
      return true;
    });
  }
}

}  // namespace trocar::impair
