#include "client/slicer/peers.h"

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <deque>
#include <map>

#include "common/base/log.h"
#include "common/base/no_throw.h"
#include "common/base/spawn.h"
#include "common/base/timing.h"
#include "common/intake/acceptor.h"

namespace trocar::slicer {
namespace {

using asio::ip::tcp;

constexpr std::size_t kChunkBytes = 256 * 1024;
constexpr std::uint64_t kSayAgainNs = 1'000'000'000;
constexpr const char* kRefusals = "Trocar_refused";

}  // namespace

struct Peers::State {
  State(asio::io_context& given, PeerEvents what)
      : context(given),
        events(std::move(what)),
        acceptor(given, {.most = kMostPeers, .most_per_address = kMostPeers}) {}

  asio::io_context& context;
  PeerEvents events;
  intake::Acceptor acceptor;
  std::map<std::string, SharedBytes> board;
  std::map<PeerId, Link*> links;
  PeerId next_id = 1;
  bool has_large = false;  // a large body is being received
};

struct Peers::Link : std::enable_shared_from_this<Peers::Link> {
  Link(std::shared_ptr<State> state, tcp::socket connected,
       std::unique_ptr<intake::Acceptor::Peer> taken)
      : all(std::move(state)),
        socket(std::move(connected)),
        peer(std::move(taken)),
        wake(all->context),
        write_limit(all->context),
        read_limit(all->context),
        id(all->next_id++) {
    for (const auto& [key, message] : all->board) waiting.push_back(key);
    all->links.emplace(id, this);
  }
  ~Link() { all->links.erase(id); }

  asio::awaitable<void> serve();
  asio::awaitable<void> write();
  // False: the connection is over.
  asio::awaitable<bool> read_message();
  asio::awaitable<bool> read_body(const Header& header, Bytes& body);
  asio::awaitable<bool> skip(std::uint64_t count);
  void ask_for(const std::string& key);
  void blame(const Error& error);
  void cut(const std::string& why);
  void limit(asio::steady_timer& timer, const char* what);

  const std::shared_ptr<State> all;
  tcp::socket socket;
  const std::unique_ptr<intake::Acceptor::Peer> peer;
  asio::steady_timer wake, write_limit, read_limit;
  const PeerId id;
  std::deque<std::string> waiting;  // keys, each once
  SharedBytes refusal;              // null: none waits
  std::string said;                 // why it was last blamed
  std::uint64_t said_ns = 0;
  int faults = 0;
  bool is_over = false;
};

void Peers::Link::cut(const std::string& why) {
  if (is_over) return;
  is_over = true;
  if (!why.empty()) log::warn("{}: {}, and is cut", peer->address(), why);
  boost::system::error_code ignored;
  socket.close(ignored);
  for (auto* timer : {&wake, &write_limit, &read_limit}) timer->cancel();
}

void Peers::Link::limit(asio::steady_timer& timer, const char* what) {
  timer.expires_after(kStall);
  timer.async_wait([self = shared_from_this(), what](const boost::system::error_code& error) {
    if (!error) self->cut(what);
  });
}

void Peers::Link::ask_for(const std::string& key) {
  if (std::find(waiting.begin(), waiting.end(), key) == waiting.end()) waiting.push_back(key);
  wake.cancel();
}

void Peers::Link::blame(const Error& error) {
  const auto now_ns = monotonic_ns();
  const bool is_known = error.message == said && now_ns - said_ns < kSayAgainNs;
  if (!is_known) {
    log::warn("{}: {}", peer->address(), error.message);
    refusal = status_message(kRefusals, Condition::Refused, error.message);
    said = error.message;
    said_ns = now_ns;
    wake.cancel();
  }
  if (error.code == ErrorCode::BadMessage && ++faults >= kMostFaults)
    cut("has said " + std::to_string(faults) + " things that are wrong");
}

asio::awaitable<void> Peers::Link::serve() {
  const auto self = shared_from_this();
  peer->speak();  // who only watches never does
  peer->set_cut([this](intake::Acceptor::Cut) { cut(""); });
  boost::system::error_code ignored;
  socket.set_option(tcp::no_delay(true), ignored);
  socket.set_option(asio::socket_base::keep_alive(true), ignored);
  log::info("{} has connected, {} are", peer->address(), all->links.size());
  spawn(socket.get_executor(), write(),
        [self](const std::exception_ptr& failure) { rethrow(failure); });
  while (!is_over && co_await read_message()) continue;
  cut("");
  log::info("{} is gone", peer->address());
  if (all->events.gone) all->events.gone(id);
}

asio::awaitable<bool> Peers::Link::skip(std::uint64_t count) {
  Bytes scratch(static_cast<std::size_t>(std::min<std::uint64_t>(count, kChunkBytes)));
  while (count > 0) {
    const auto part = static_cast<std::size_t>(std::min<std::uint64_t>(count, scratch.size()));
    const auto [error, got] =
        co_await asio::async_read(socket, asio::buffer(scratch.data(), part), kNoThrow);
    if (error) co_return false;
    count -= got;
  }
  co_return true;
}

asio::awaitable<bool> Peers::Link::read_body(const Header& header, Bytes& body) {
  const auto size = static_cast<std::size_t>(header.body_bytes);
  limit(read_limit, "has not ended a message within a minute");
  while (body.size() < size) {
    const std::size_t had = body.size();
    body.resize(std::min(size, had + kChunkBytes));
    const auto [error, got] = co_await asio::async_read(
        socket, asio::buffer(body.data() + had, body.size() - had), kNoThrow);
    if (error) co_return false;
  }
  read_limit.cancel();
  co_return true;
}

asio::awaitable<bool> Peers::Link::read_message() {
  std::array<std::uint8_t, kHeaderBytes> bytes{};
  const auto [error, got] = co_await asio::async_read(socket, asio::buffer(bytes), kNoThrow);
  if (error) co_return false;
  PeerMessage message{.peer = id, .header = {}, .body = {}};
  auto header = read_header(bytes);
  if (!header) {
    cut(header.error().message);
    co_return false;
  }
  message.header = std::move(*header);
  if (message.header.kind() == Kind::Other) co_return co_await skip(message.header.body_bytes);
  Status fits = check_size(message.header);
  const bool is_large = message.header.body_bytes > kLargeBytes;
  if (fits && is_large && all->has_large)
    fits = Error{ErrorCode::Refused, message.header.name() +
                                         ": another large message is under way, "
                                         "send it again"};
  if (!fits) {
    blame(fits.error());
    co_return co_await skip(message.header.body_bytes);
  }
  if (is_large) all->has_large = true;
  const bool is_whole = co_await read_body(message.header, message.body);
  if (is_large) all->has_large = false;
  if (!is_whole || is_over) co_return false;
  all->events.heard(std::move(message));
  co_return true;
}

asio::awaitable<void> Peers::Link::write() {
  const auto self = shared_from_this();
  while (!is_over) {
    SharedBytes message = std::exchange(refusal, nullptr);
    if (!message && !waiting.empty()) {
      const auto found = all->board.find(waiting.front());
      if (found != all->board.end()) message = found->second;
      waiting.pop_front();
      if (!message) continue;  // it was retracted
    }
    if (!message) {
      wake.expires_at(asio::steady_timer::time_point::max());
      co_await wake.async_wait(kNoThrow);
      continue;
    }
    limit(write_limit, "has taken nothing for a minute");
    const auto [error, count] =
        co_await asio::async_write(socket, asio::buffer(*message), kNoThrow);
    if (error) cut("");
    write_limit.cancel();
  }
}

Peers::Peers(asio::io_context& context, PeerEvents events)
    : state_(std::make_shared<State>(context, std::move(events))) {}

Peers::~Peers() {
  close();
}

Status Peers::open(const std::string& address, std::uint16_t port) {
  if (auto opened = state_->acceptor.open(address, port, "--listen"); !opened) return opened;
  state_->acceptor.start(
      [state = std::weak_ptr<State>(state_)](
          tcp::socket socket,
          std::unique_ptr<intake::Acceptor::Peer> peer) -> asio::awaitable<void> {
        const auto all = state.lock();
        if (!all) co_return;
        co_await std::make_shared<Link>(all, std::move(socket), std::move(peer))->serve();
      });
  return {};
}

std::uint16_t Peers::port() const {
  return state_->acceptor.port();
}

int Peers::count() const {
  return static_cast<int>(state_->links.size());
}

void Peers::publish(const std::string& key, SharedBytes message) {
  state_->board[key] = std::move(message);
  for (const auto& [id, link] : state_->links) link->ask_for(key);
}

void Peers::retract(const std::string& key) {
  state_->board.erase(key);
}

void Peers::blame(PeerId peer, const Error& error) {
  const auto found = state_->links.find(peer);
  if (found != state_->links.end()) found->second->blame(error);
}

void Peers::close() {
  state_->acceptor.stop();
  state_->events = {.heard = [](PeerMessage) {}, .gone = {}};
  for (const auto& [id, link] : state_->links) link->cut("");
}

}  // namespace trocar::slicer
