#include "server/session/net/datagram_server.h"

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <cerrno>

#include "common/base/no_throw.h"
#include "common/base/spawn.h"
#include "server/session/net/datagram_socket.h"

namespace trocar::net {
namespace {

using asio::ip::udp;
constexpr int kReceiveBufferBytes = 1024 * 1024;
constexpr std::size_t kReceiveRoom = 2048;  // what is longer than a datagram of ours fails to open
constexpr int kDatagramsPerWake = 64;       // so that a flood does not keep streams waiting

std::string text_of(const udp::endpoint& peer) {
  return peer.address().to_string() + " " + std::to_string(peer.port());
}

}  // namespace

DatagramServer::DatagramServer(asio::io_context& context, Deliver deliver)
    : socket_(context),
      deliver_(std::move(deliver)),
      listener_([this](const KeyId& id) -> std::optional<secure::Digest> {
        const auto found = keys_.find(id);
        if (found == keys_.end()) return std::nullopt;
        return found->second.second;
      }) {}

DatagramServer::~DatagramServer() {
  *is_alive_ = false;
  boost::system::error_code ignored;
  socket_.close(ignored);
}

Result<std::unique_ptr<DatagramServer>> DatagramServer::open(asio::io_context& context,
                                                             const udp::endpoint& endpoint,
                                                             Deliver deliver) {
  std::unique_ptr<DatagramServer> server(new DatagramServer(context, std::move(deliver)));
  boost::system::error_code error, ignored;
  server->socket_.open(endpoint.protocol(), error);
  if (!error && !ask_for_local_addresses(server->socket_))
    error = boost::system::error_code(errno, boost::system::system_category());
  if (!error) server->socket_.bind(endpoint, error);
  if (!error) server->socket_.non_blocking(true, error);
  if (error)
    return Error{ErrorCode::ResourceMissing, "port " + std::to_string(endpoint.port()) +
                                                 " cannot be used for datagrams (" +
                                                 error.message() + ")"};
  server->socket_.set_option(asio::socket_base::receive_buffer_size(kReceiveBufferBytes), ignored);
  spawn(context.get_executor(), server->receive(server->is_alive_),
        [](std::exception_ptr failure) { rethrow(failure); });
  return server;
}

asio::awaitable<void> DatagramServer::receive(std::shared_ptr<bool> is_alive) {
  Bytes room(kReceiveRoom);
  while (*is_alive) {
    const auto [error] = co_await socket_.async_wait(udp::socket::wait_read, kNoThrow);
    if (!*is_alive || error) break;
    for (int i = 0; i < kDatagramsPerWake; ++i) {
      const auto arrival = receive_datagram(socket_, room);
      if (!arrival) break;  // nothing more there; or a peer that is gone, of which the stream tells
      arrived_at_ = arrival->local;
      take(arrival->peer, BytesView(room).first(arrival->bytes));
      if (!*is_alive) co_return;
    }
  }
}

void DatagramServer::take(const Endpoint& peer, BytesView datagram) {
  ++counters_.received;
  counters_.bytes_in += datagram.size();
  const auto found = paths_.find(peer);
  if (found == paths_.end()) return greet(peer, datagram);
  auto& path = found->second;
  const auto id = path.connection;
  const auto state = path.channel->receive(datagram, [this, id](BytesView message) {
    if (id != 0) deliver_(id, message);
  });
  // Delivering may have ended the connection, and its path with it.
  const auto again = paths_.find(peer);
  if (again == paths_.end()) return;
  if (state == secure::DatagramChannel::State::Failed) {
    if (id != 0) endpoint_of_.erase(id);
    paths_.erase(again);
    greet(peer, datagram);
  } else if (id == 0) {
    settle(peer, again->second);
  }
}

void DatagramServer::greet(const Endpoint& peer, BytesView datagram) {
  auto channel = listener_.receive(datagram, text_of(peer),
                                   [this, peer](BytesView bytes) { send_to(peer, bytes); });
  if (!channel) return;
  make_room_for_newcomer(peer);
  paths_[peer] = {std::move(channel), 0, arrived_at_, Clock::now()};
}

// Who means it is done in milliseconds. Of too many the oldest goes, of the address that has most:
// so who leaves many unfinished drives out his own.
void DatagramServer::make_room_for_newcomer(const Endpoint& peer) {
  std::map<asio::ip::address, std::size_t> counts;
  std::size_t unfinished = 0;
  for (const auto& [endpoint, path] : paths_) {
    if (path.connection != 0) continue;
    ++unfinished;
    ++counts[endpoint.address()];
  }
  const bool has_room = unfinished < kMaxUnfinished;
  if (has_room && counts[peer.address()] < kMaxUnfinishedPerAddress) return;
  const auto most =
      std::ranges::max_element(counts, {}, [](const auto& one) { return one.second; })->second;
  auto oldest = paths_.end();
  for (auto next = paths_.begin(); next != paths_.end(); ++next)
    if (next->second.connection == 0 && counts[next->first.address()] == most &&
        (oldest == paths_.end() || next->second.begin < oldest->second.begin))
      oldest = next;
  paths_.erase(oldest);
  ++counters_.refused;
}

// A handshake that is finished gives its connection a path, in place of any other.
void DatagramServer::settle(const Endpoint& peer, Path& path) {
  if (path.channel->state() != secure::DatagramChannel::State::Open) return;
  const auto key = keys_.find(path.channel->key_id());
  if (key == keys_.end()) {
    paths_.erase(peer);
    return;
  }
  const auto id = key->second.first;
  if (const auto old = endpoint_of_.find(id); old != endpoint_of_.end()) paths_.erase(old->second);
  path.connection = id;
  endpoint_of_[id] = peer;
  ++counters_.paths;
}

void DatagramServer::send_to(const Endpoint& peer, BytesView datagram) {
  const auto path = paths_.find(peer);
  const bool is_sent = send_datagram(socket_, datagram, peer,
                                     path == paths_.end() ? arrived_at_ : path->second.local);
  ++(is_sent ? counters_.sent : counters_.dropped);
  if (is_sent) counters_.bytes_out += datagram.size();
}

void DatagramServer::expect(ConnectionId id, const secure::DatagramKey& key) {
  keys_[key.id] = {id, key.secret};
  key_of_[id] = key.id;
}

void DatagramServer::forget(ConnectionId id) {
  if (const auto key = key_of_.find(id); key != key_of_.end()) {
    keys_.erase(key->second);
    key_of_.erase(key);
  }
  if (const auto endpoint = endpoint_of_.find(id); endpoint != endpoint_of_.end()) {
    // Kept until the sweep: the channel may be the one that is delivering at this moment.
    paths_[endpoint->second].connection = 0;
    paths_[endpoint->second].begin = {};
    endpoint_of_.erase(endpoint);
  }
}

bool DatagramServer::has_path(ConnectionId id) const {
  return endpoint_of_.contains(id);
}

bool DatagramServer::send(ConnectionId id, BytesView message) {
  const auto endpoint = endpoint_of_.find(id);
  if (endpoint == endpoint_of_.end()) return false;
  const auto dropped = counters_.dropped;
  return paths_[endpoint->second].channel->send(message) && counters_.dropped == dropped;
}

void DatagramServer::sweep() {
  const auto now = Clock::now();
  for (auto next = paths_.begin(); next != paths_.end();) {
    auto& path = next->second;
    const bool is_late = path.connection == 0 && now - path.begin > kHandshakeDeadline;
    if (is_late) {
      next = paths_.erase(next);
      continue;
    }
    const auto left = path.channel->next_timeout();
    if (left && left->count() == 0) path.channel->on_timeout();
    ++next;
  }
}

}  // namespace trocar::net
