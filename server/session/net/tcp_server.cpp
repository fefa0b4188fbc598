#include "server/session/net/tcp_server.h"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <map>
#include <vector>

#include "common/base/log.h"
#include "common/base/spawn.h"
#include "common/intake/acceptor.h"
#include "server/session/net/connection.h"

namespace trocar::net {
namespace {

// Deadlines are seconds; nobody notices a quarter of one.
constexpr std::chrono::milliseconds kSweepPeriod{100};

intake::Limits limits_of(const TcpServerOptions& options) {
  return {.most = options.max_connections,
          .most_silent = options.max_newcomers,
          .most_silent_per_address = options.max_newcomers_per_address,
          .time_to_speak = options.hello_deadline};
}

}  // namespace

class TcpServer::Core : public std::enable_shared_from_this<TcpServer::Core> {
 public:
  Core(asio::io_context& io, const TcpServerOptions& chosen)
      : options(chosen), context(io), acceptor(io, limits_of(chosen)), sweep(io) {}

  Status open() {
    if (auto opened = acceptor.open(options.address, options.port, "--listen"); !opened)
      return opened;
    if (options.tls && options.has_datagrams)
      open_datagrams({asio::ip::make_address(options.address), acceptor.port()});
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
    acceptor.start(
        [self](auto socket, auto peer) { return self->admit(std::move(socket), std::move(peer)); });
    spawn(context.get_executor(), sweep_deadlines(),
          [self](std::exception_ptr failure) { rethrow(failure); });
  }

  void stop() {
    acceptor.stop();
    handler = nullptr;
    datagrams.reset();
    sweep.cancel();
    const auto all = std::move(connections);
    connections.clear();
    for (const auto& [id, one] : all) one.connection->close();
  }

  Connection* find(ConnectionId id) const {
    const auto found = connections.find(id);
    return found == connections.end() ? nullptr : found->second.connection.get();
  }

  const TcpServerOptions options;
  asio::io_context& context;
  std::unique_ptr<DatagramServer> datagrams;  // null: there are none
  intake::Acceptor acceptor;
  asio::steady_timer sweep;
  ConnectionHandler* handler = nullptr;  // null once stopped
  struct One {
    std::shared_ptr<Connection> connection;
    std::unique_ptr<intake::Acceptor::Peer> peer;
    bool is_open = false;  // the handler has heard of it
  };
  std::map<ConnectionId, One> connections;
  ConnectionId next_id = 1;
  TcpCounters counters;

 private:
  asio::awaitable<void> admit(asio::ip::tcp::socket socket,
                              std::unique_ptr<intake::Acceptor::Peer> peer) {
    if (!handler) co_return;
    boost::system::error_code ignored;
    socket.set_option(asio::socket_base::send_buffer_size(options.send_buffer_bytes), ignored);
    const ConnectionId id = next_id++;
    auto connection = std::make_shared<Connection>(secure::Stream(std::move(socket), options.tls),
                                                   peer->address(), options.max_message_bytes,
                                                   options.outbox_bytes, options.plain_reply);
    // Who is late is told so, once there is TLS.
    peer->set_cut([held = std::weak_ptr(connection)](intake::Acceptor::Cut why) {
      const auto one = held.lock();
      if (!one) return;
      if (why == intake::Acceptor::Cut::Late && !one->is_greeting())
        one->fail(ConnectionFault::HelloTimeout);
      else
        one->close();
    });
    connections.emplace(id, One{connection, std::move(peer)});
    connection->start(events_of(id));
  }

  void expect_datagrams(ConnectionId id) {
    const auto key = datagrams ? find(id)->datagram_key() : std::nullopt;
    if (key) datagrams->expect(id, *key);
  }

  Connection::Events events_of(ConnectionId id) {
    const auto self = shared_from_this();
    Connection::Events events;
    events.open = [self, id] {
      auto& one = self->connections.at(id);
      one.is_open = true;
      one.peer->show_life();
      self->expect_datagrams(id);
      if (self->handler) self->handler->on_open(id);
    };
    events.message = [self, id](BytesView message) {
      if (const auto one = self->connections.find(id); one != self->connections.end())
        one->second.peer->speak();
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
      if (self->datagrams) self->datagrams->forget(id);
      const auto gone = self->connections.extract(id);
      if (gone.empty()) return;
      if (!gone.mapped().is_open) ++self->counters.handshakes_failed;
      if (gone.mapped().is_open && self->handler) self->handler->on_close(id);
    };
    return events;
  }

  asio::awaitable<void> sweep_deadlines() {
    std::vector<std::shared_ptr<Connection>> all;
    while (handler) {
      sweep.expires_after(kSweepPeriod);
      co_await sweep.async_wait(kNoThrow);
      if (!handler) break;
      all.clear();  // a copy: handlers close connections while we look at them
      for (const auto& [id, one] : connections) all.push_back(one.connection);
      const auto now = Connection::Clock::now();
      for (const auto& connection : all) connection->check_deadlines(now, options.idle_deadline);
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
  core_->acceptor.stop();
}
std::uint16_t TcpServer::port() const {
  return core_->acceptor.port();
}
std::size_t TcpServer::connection_count() const {
  return core_->connections.size();
}
TcpCounters TcpServer::counters() const {
  auto counters = core_->counters;
  const auto& taken = core_->acceptor.counters();
  counters.accepted = taken.accepted;
  counters.rejected_full = taken.refused;
  counters.newcomers_dropped = taken.cut;
  return counters;
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
  const auto connection = found->second.connection;
  connection->close();
}

}  // namespace trocar::net
