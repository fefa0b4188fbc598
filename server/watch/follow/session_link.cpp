#include "server/watch/follow/session_link.h"

#include <array>
#include <boost/asio/detached.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <memory>

#include "common/base/no_throw.h"

namespace trocar::follow {
namespace {

using tcp = asio::ip::tcp;

constexpr std::chrono::seconds kReachDeadline{5};
// Small, so that old frames wait at the session, which leaves them out, and not on the way.
constexpr int kReceiveBytes = 64 * 1024;

}  // namespace

SessionLink::SessionLink(asio::any_io_executor executor, Sessions& sessions)
    : executor_(std::move(executor)), sessions_(sessions), deadline_(executor_) {}

void SessionLink::cut() {
  is_cut_ = true;
  boost::system::error_code ignored;
  if (stream_) stream_->socket().close(ignored);
}

// Coroutines here hold no temporaries across a co_await: GCC 12 miscompiles some of them otherwise.
asio::awaitable<bool> SessionLink::open(const SessionAddress& session) {
  why_ = "the session at " + session.name + " cannot be reached: is it running?";
  const bool is_open = co_await open_at(session);
  if (is_open) co_return true;
  const auto further = sessions_.further_of(session.name);  // a copy: others may add to them
  for (const auto& place : further.places) {
    if (is_cut_) break;
    const bool is_there = co_await open_at(place);
    if (is_there && code_ == further.code) co_return true;
    if (is_there)
      why_ = place.name + " is no other address of this session: its certificate differs";
  }
  co_return false;
}

asio::awaitable<bool> SessionLink::open_at(const SessionAddress& place) {
  tcp::resolver resolver(executor_);
  const std::string port = std::to_string(place.port);
  const auto [unresolved, endpoints] = co_await resolver.async_resolve(place.host, port, kNoThrow);
  if (unresolved) co_return false;
  for (const auto& entry : endpoints) {
    if (is_cut_) break;
    // A deadline that has just passed is no other try's.
    const auto is_under_way = std::make_shared<bool>(true);
    deadline_.expires_after(kReachDeadline);
    deadline_.async_wait([this, is_under_way](boost::system::error_code error) {
      boost::system::error_code ignored;
      if (!error && *is_under_way) stream_->socket().close(ignored);
    });
    const tcp::endpoint endpoint = entry.endpoint();
    const bool is_open = co_await try_at(place, endpoint);
    *is_under_way = false;
    deadline_.cancel();
    if (is_open) co_return !is_cut_;
  }
  co_return false;
}

asio::awaitable<bool> SessionLink::try_at(const SessionAddress& place,
                                          const asio::ip::tcp::endpoint& endpoint) {
  tcp::socket socket(executor_);
  boost::system::error_code ignored;
  socket.open(endpoint.protocol(), ignored);
  socket.set_option(asio::socket_base::receive_buffer_size(kReceiveBytes), ignored);
  stream_.emplace(std::move(socket), sessions_.tls());
  const auto [refused] = co_await stream_->socket().async_connect(endpoint, kNoThrow);
  if (refused || is_cut_) co_return false;
  stream_->socket().set_option(tcp::no_delay(true), ignored);
  const auto error = co_await stream_->begin_tls(place.host);
  if (error) {
    why_ = place.name + ": " + secure::describe_handshake_failure(error);
    co_return false;
  }
  const Bytes der = stream_->peer_certificate_der();
  code_ = sessions_.code_of(der);
  co_return true;
}

asio::awaitable<bool> SessionLink::read(Bytes& body) {
  std::array<std::uint8_t, wire::kHeaderBytes> header{};
  const auto head = co_await stream_->read_all(asio::buffer(header));
  if (head.error) co_return false;
  const auto length = wire::decode_length(header, wire::kMaxDownstreamBytes);
  if (!length) co_return false;
  body.resize(*length);
  const auto rest = co_await stream_->read_all(asio::buffer(body));
  if (rest.error) co_return false;
  ++sessions_.messages;
  sessions_.bytes += body.size() + wire::kHeaderBytes;
  co_return true;
}

asio::awaitable<bool> SessionLink::write(BytesView framed) {
  const std::vector<asio::const_buffer> buffers{asio::buffer(framed.data(), framed.size())};
  const auto sent = co_await stream_->write_all(buffers);
  co_return !sent.error;
}

}  // namespace trocar::follow
