#include "server/session/net/tcp_server.h"

#include <algorithm>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <map>
#include <set>
#include <vector>

#include "common/base/log.h"
#include "common/base/spawn.h"
#include "server/session/net/connection.h"

namespace trocar::net {
namespace {

using asio::ip::tcp;
// Deadlines are seconds; nobody notices a quarter of one.
constexpr std::chrono::milliseconds kSweepPeriod{100};
// After a failed accept (no file descriptors left): wait instead of spinning.
constexpr std::chrono::milliseconds kAcceptRetry{100};

}  // namespace

class TcpServer::Core : public std::enable_shared_from_this<TcpServer::Core> {
 public:
  Core(asio::io_context& io, const TcpServerOptions& chosen)
      : options(chosen), context(io), acceptor(io), sweep(io), retry(io) {}

  Status open() {
    if (const auto checked = check_listen_address(options.address); !checked) return checked;
    boost::system::error_code error;
    const tcp::endpoint endpoint(asio::ip::make_address(options.address, error), options.port);
    acceptor.open(endpoint.protocol(), error);
    if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
    if (!error) acceptor.bind(endpoint, error);
    if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
    if (error)
      return Error{ErrorCode::ResourceMissing,
                   "port " + std::to_string(options.port) + " at " + options.address +
                       " cannot be used (" + error.message() +
                       "): stop the program that has it or choose another with --listen"};
    port = acceptor.local_endpoint(error).port();
    if (options.tls && options.has_datagrams)
      open_datagrams(asio::ip::udp::endpoint(endpoint.address(), port));
    return {};
  }

  // Without them everything goes over the stream.
  void open_datagrams(const asio::ip::udp::endpoint& endpoint) {
    auto made = DatagramServer::open(context, endpoint, [this](ConnectionId id, BytesView message) {
      if (handler) handler->on_datagram(id, message);
    });
    if (made)
      datagrams = std::move(*made);
    else
      log::warn("{}: pictures will wait for lost packets", made.error().message);
  }

  void start(ConnectionHandler& to) {
    handler = &to;
    const auto self = shared_from_this();
    spawn(acceptor.get_executor(), accept_connections(),
          [self](std::exception_ptr failure) { rethrow(failure); });
    spawn(acceptor.get_executor(), sweep_deadlines(),
          [self](std::exception_ptr failure) { rethrow(failure); });
  }

  void stop_accepting() {
    boost::system::error_code ignored;
    acceptor.close(ignored);
    retry.cancel();
  }

  void stop() {
    stop_accepting();
    handler = nullptr;
    datagrams.reset();
    sweep.cancel();
    const auto all = std::move(connections);
    connections.clear();
    for (const auto& [id, connection] : all) connection->close();
  }

  Connection* find(ConnectionId id) const {
    const auto found = connections.find(id);
    return found == connections.end() ? nullptr : found->second.get();
  }

  const TcpServerOptions options;
  asio::io_context& context;
  std::unique_ptr<DatagramServer> datagrams;  // null: there are none
  tcp::acceptor acceptor;
  asio::steady_timer sweep, retry;
  ConnectionHandler* handler = nullptr;  // null once stopped
  std::map<ConnectionId, std::shared_ptr<Connection>> connections;
  std::set<ConnectionId> opened;  // those that the handler has heard of
  ConnectionId next_id = 1;
  std::uint16_t port = 0;
  TcpCounters counters;

 private:
  void admit(tcp::socket socket) {
    boost::system::error_code ignored;
    if (connections.size() >= options.max_connections) {
      ++counters.rejected_full;
      socket.close(ignored);
      return;
    }
    const auto peer = socket.remote_endpoint(ignored).address().to_string();
    if (options.tls) make_room_for_newcomer(peer);
    ++counters.accepted;
    socket.set_option(tcp::no_delay(true), ignored);
    socket.set_option(asio::socket_base::send_buffer_size(options.send_buffer_bytes), ignored);
    const ConnectionId id = next_id++;
    auto connection = std::make_shared<Connection>(secure::Stream(std::move(socket), options.tls),
                                                   peer, options.max_message_bytes,
                                                   options.outbox_bytes, options.plain_reply);
    connections.emplace(id, connection);
    connection->start(events_of(id));
  }

  // Who means it is done in milliseconds; so of too many the oldest is most likely one who does
  // not, first of all if it has not got as far as TLS.
  void make_room_for_newcomer(const std::string& peer) {
    std::vector<std::shared_ptr<Connection>> newcomers, of_same;  // numbers ascend with time
    for (const auto& [id, connection] : connections) {
      if (!connection->is_newcomer()) continue;
      newcomers.push_back(connection);
      if (connection->peer_address() == peer) of_same.push_back(connection);
    }
    if (of_same.size() >= options.max_newcomers_per_address)
      drop_oldest(of_same);
    else if (newcomers.size() >= options.max_newcomers)
      drop_oldest(newcomers);
  }

  void drop_oldest(const std::vector<std::shared_ptr<Connection>>& newcomers) {
    ++counters.newcomers_dropped;
    const auto greeting =
        std::ranges::find_if(newcomers, [](const auto& c) { return c->is_greeting(); });
    (greeting != newcomers.end() ? *greeting : newcomers.front())->close();
  }

  void expect_datagrams(ConnectionId id) {
    const auto key = datagrams ? find(id)->datagram_key() : std::nullopt;
    if (key) datagrams->expect(id, *key);
  }

  Connection::Events events_of(ConnectionId id) {
    const auto self = shared_from_this();
    Connection::Events events;
    events.open = [self, id] {
      self->opened.insert(id);
      self->expect_datagrams(id);
      if (self->handler) self->handler->on_open(id);
    };
    events.message = [self, id](BytesView message) {
      ++self->counters.messages_in;
      self->counters.bytes_in += message.size() + wire::kHeaderBytes;
      if (self->handler) self->handler->on_message(id, message);
    };
    events.fault = [self, id](ConnectionFault fault) {
      ++self->counters.faults;
      if (self->handler) self->handler->on_fault(id, fault);
    };
    events.bytes_written = [self](std::size_t count) { self->counters.bytes_out += count; };
    events.closed = [self, id] {
      const bool was_open = self->opened.erase(id) > 0;
      if (self->datagrams) self->datagrams->forget(id);
      if (self->connections.erase(id) == 0) return;
      if (!was_open) ++self->counters.handshakes_failed;
      if (was_open && self->handler) self->handler->on_close(id);
    };
    return events;
  }

  asio::awaitable<void> accept_connections() {
    while (handler && acceptor.is_open()) {
      auto [error, socket] = co_await acceptor.async_accept(kNoThrow);
      if (!handler || !acceptor.is_open()) break;
      if (error) {
        retry.expires_after(kAcceptRetry);
        co_await retry.async_wait(kNoThrow);
        continue;
      }
      admit(std::move(socket));
    }
  }

  asio::awaitable<void> sweep_deadlines() {
    std::vector<std::shared_ptr<Connection>> all;
    while (handler) {
      sweep.expires_after(kSweepPeriod);
      co_await sweep.async_wait(kNoThrow);
      if (!handler) break;
      all.clear();  // a copy: handlers close connections while we look at them
      for (const auto& [id, connection] : connections) all.push_back(connection);
      const auto now = Connection::Clock::now();
      for (const auto& connection : all)
        connection->check_deadlines(now, options.hello_deadline, options.idle_deadline);
      all.clear();
      if (datagrams) datagrams->sweep();
    }
  }
};

Status run(asio::io_context& context) {
  const auto failed = [](const char* what) {
    return Error{ErrorCode::ResourceMissing,
                 std::string("the session has ended: its network thread failed (") + what + ")"};
  };
  try {
    context.run();
  } catch (const std::exception& exception) {
    return failed(exception.what());
  } catch (...) {
    return failed("unknown");
  }
  return {};
}

Status check_listen_address(const std::string& address) {
  boost::system::error_code error;
  asio::ip::make_address(address, error);
  if (!error) return {};
  return Error{ErrorCode::Usage, "--listen: '" + address +
                                     "' is not an IPv4 or IPv6 address: use 127.0.0.1 for this "
                                     "machine only, 0.0.0.0 for any"};
}

Result<std::unique_ptr<TcpServer>> TcpServer::listen(asio::io_context& context,
                                                     const TcpServerOptions& options) {
  auto core = std::make_shared<Core>(context, options);
  if (const auto opened = core->open(); !opened) return opened.error();
  return std::unique_ptr<TcpServer>(new TcpServer(std::move(core)));
}

TcpServer::TcpServer(std::shared_ptr<Core> core) : core_(std::move(core)) {}
TcpServer::~TcpServer() {
  core_->stop();
}

void TcpServer::start(ConnectionHandler& handler) {
  core_->start(handler);
}
void TcpServer::stop_accepting() {
  core_->stop_accepting();
}
std::uint16_t TcpServer::port() const {
  return core_->port;
}
std::size_t TcpServer::connection_count() const {
  return core_->connections.size();
}
const TcpCounters& TcpServer::counters() const {
  return core_->counters;
}

bool TcpServer::send(ConnectionId id, wire::SharedBytes frame) {
  auto* connection = core_->find(id);
  return connection && connection->send(std::move(frame));
}

bool TcpServer::has_datagrams() const {
  return core_->datagrams != nullptr;
}

bool TcpServer::has_datagrams(ConnectionId id) const {
  return core_->datagrams && core_->datagrams->has_path(id);
}

bool TcpServer::send_datagram(ConnectionId id, BytesView message) {
  return core_->datagrams && core_->datagrams->send(id, message);
}

DatagramCounters TcpServer::datagram_counters() const {
  return core_->datagrams ? core_->datagrams->counters() : DatagramCounters{};
}

std::size_t TcpServer::outstanding_bytes(ConnectionId id) const {
  const auto* connection = core_->find(id);
  return connection ? connection->outstanding_bytes() : 0;
}

std::string TcpServer::peer_address(ConnectionId id) const {
  const auto* connection = core_->find(id);
  return connection ? connection->peer_address() : std::string();
}

void TcpServer::close_after_flush(ConnectionId id, wire::SharedBytes last_words) {
  if (auto* connection = core_->find(id))
    connection->close_after_flush(std::move(last_words),
                                  Connection::Clock::now() + core_->options.flush_deadline);
}

void TcpServer::close(ConnectionId id) {
  // A copy of the pointer: closing erases it from the map.
  const auto found = core_->connections.find(id);
  if (found == core_->connections.end()) return;
  const auto connection = found->second;
  connection->close();
}

}  // namespace trocar::net
