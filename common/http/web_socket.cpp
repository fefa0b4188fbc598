#include "common/http/web_socket.h"

#include <algorithm>
#include <boost/asio/async_result.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>

#include "common/base/no_throw.h"

namespace trocar::http {
namespace {

namespace beast = boost::beast;
namespace websocket = beast::websocket;
using boost::system::error_code;

// Silence after which the browser is asked, and after twice as much given up.
constexpr std::chrono::seconds kIdle{10}, kHandshakeDeadline{5};

}  // namespace

// A stream as Beast wants it, with TLS or without. What is called at an operation's end has one
// type here, so that one WebSocket is compiled, and not one for each stream below.
class WebSocket::Below {
 public:
  using executor_type = asio::any_io_executor;

  explicit Below(std::shared_ptr<secure::Stream> stream) : stream_(std::move(stream)) {}

  executor_type get_executor() { return stream_->socket().get_executor(); }

  template <typename Buffers, typename Token>
  auto async_read_some(const Buffers& buffers, Token&& token) {
    return asio::async_initiate<Token, void(error_code, std::size_t)>(
        [this](auto handler, asio::mutable_buffer to) {
          stream_->read_some(to, erased(std::move(handler)));
        },
        token, asio::mutable_buffer(*asio::buffer_sequence_begin(buffers)));
  }

  // They go out as one, as much as a record of TLS takes: each would be a record of its own.
  template <typename Buffers, typename Token>
  auto async_write_some(const Buffers& buffers, Token&& token) {
    joined_.resize(std::min(asio::buffer_size(buffers), kPieceBytes));
    asio::buffer_copy(asio::buffer(joined_), buffers);
    return asio::async_initiate<Token, void(error_code, std::size_t)>(
        [this](auto handler) {
          stream_->write_some(asio::buffer(joined_), erased(std::move(handler)));
        },
        token);
  }

  void close() {
    error_code ignored;
    stream_->socket().close(ignored);
  }

  friend void beast_close_socket(Below& below) { below.close(); }
  friend void teardown(beast::role_type, Below& below, error_code& error) {
    below.stream_->socket().shutdown(asio::socket_base::shutdown_both, error);
  }
  template <typename Handler>
  friend void async_teardown(beast::role_type, Below& below, Handler&& handler) {
    error_code ignored;
    below.stream_->socket().shutdown(asio::socket_base::shutdown_send, ignored);
    below.drain([done = shared(std::forward<Handler>(handler))](error_code error, std::size_t) {
      std::move (*done)(error);
    });
  }

 private:
  template <typename Handler>
  static auto shared(Handler&& handler) {
    return std::make_shared<std::decay_t<Handler>>(std::forward<Handler>(handler));
  }
  template <typename Handler>
  static secure::Stream::Done erased(Handler&& handler) {
    return [done = shared(std::forward<Handler>(handler))](error_code error, std::size_t count) {
      std::move (*done)(error, count);
    };
  }

  // Takes what the peer has sent: a socket that is closed with unread bytes resets, and the last
  // words could be lost.
  void drain(secure::Stream::Done done) {
    joined_.resize(kPieceBytes);
    stream_->socket().async_read_some(
        asio::buffer(joined_), [this, done = std::move(done)](error_code error, std::size_t) {
          if (!error) return drain(done);
          close();
          done(error == asio::error::eof ? error_code() : error, 0);
        });
  }

  static constexpr std::size_t kPieceBytes = 16 * 1024;

  const std::shared_ptr<secure::Stream> stream_;
  Bytes joined_;
};

struct WebSocket::Core {
  websocket::stream<Below> stream;
  beast::flat_buffer buffer;
};

WebSocket::WebSocket(Stream& stream, std::string peer_address, std::size_t most_bytes)
    : core_(
          new Core{websocket::stream<Below>(stream.share_below()), beast::flat_buffer(most_bytes)}),
      peer_(std::move(peer_address)) {
  stream.end_never();
  core_->stream.set_option(websocket::stream_base::timeout{.handshake_timeout = kHandshakeDeadline,
                                                           .idle_timeout = 2 * kIdle,
                                                           .keep_alive_pings = true});
  core_->stream.read_message_max(most_bytes);
  core_->stream.auto_fragment(false);
  core_->stream.binary(true);
}

WebSocket::~WebSocket() = default;

asio::any_io_executor WebSocket::executor() {
  return core_->stream.get_executor();
}

asio::awaitable<bool> WebSocket::accept(const Request& request) {
  beast::http::request<beast::http::string_body> again(beast::http::verb::get, request.target, 11);
  for (const auto& [name, value] : request.fields) again.insert(name, value);
  const auto [error] = co_await core_->stream.async_accept(again, kNoThrow);
  co_return !error;
}

asio::awaitable<WebMessage> WebSocket::read() {
  WebMessage message;
  core_->buffer.clear();
  const auto [error, count] = co_await core_->stream.async_read(core_->buffer, kNoThrow);
  if (error) {
    // Only a page that leaves says so; what breaks off may come back.
    const auto code = core_->stream.reason().code;
    const bool leaves =
        error == websocket::error::closed &&
        (code == websocket::close_code::normal || code == websocket::close_code::going_away);
    message.kind = leaves ? WebMessage::Kind::Closed : WebMessage::Kind::Lost;
    co_return message;
  }
  message.kind = core_->stream.got_text() ? WebMessage::Kind::Text : WebMessage::Kind::Binary;
  const auto* from = static_cast<const std::uint8_t*>(core_->buffer.data().data());
  message.bytes.assign(from, from + count);
  co_return message;
}

asio::awaitable<bool> WebSocket::write(BytesView bytes) {
  const auto buffer = asio::buffer(bytes.data(), bytes.size());
  const auto [error, count] = co_await core_->stream.async_write(buffer, kNoThrow);
  co_return !error;
}

asio::awaitable<void> WebSocket::close() {
  if (!core_->stream.is_open()) co_return;
  const websocket::close_reason reason(websocket::close_code::normal);
  co_await core_->stream.async_close(reason, kNoThrow);
}

void WebSocket::cut() {
  core_->stream.next_layer().close();
}

}  // namespace trocar::http
