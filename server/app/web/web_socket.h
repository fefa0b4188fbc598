#pragma once

// A WebSocket over TLS or without, by Boost.Beast, as the bridge wants it. Messages of a browser
// are bounded, the connection ends when the browser is silent, and nothing is compressed: frames
// hardly get smaller, and each watcher would take its own compressor.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/ssl/ssl_stream.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <chrono>
#include <string>

#include "common/base/no_throw.h"
#include "common/wire/framing.h"
#include "server/watch/page/browser_socket.h"

namespace trocar::app {

namespace beast = boost::beast;

// Silence after which the browser is asked, and after twice as much given up.
inline constexpr std::chrono::seconds kIdle{10};

template <typename Below>  // beast::tcp_stream, or TLS above it
class WebSocket final : public page::BrowserSocket {
 public:
  WebSocket(Below below, std::string peer) : stream_(std::move(below)), peer_(std::move(peer)) {
    beast::get_lowest_layer(stream_).expires_never();
    stream_.set_option(
        beast::websocket::stream_base::timeout{.handshake_timeout = std::chrono::seconds(5),
                                               .idle_timeout = 2 * kIdle,
                                               .keep_alive_pings = true});
    stream_.read_message_max(wire::kMaxUpstreamBytes);
    stream_.auto_fragment(false);
    stream_.binary(true);
  }

  asio::awaitable<bool> accept(const beast::http::request<beast::http::string_body>& request) {
    const auto [error] = co_await stream_.async_accept(request, kNoThrow);
    co_return !error;
  }

  asio::any_io_executor executor() override { return stream_.get_executor(); }

  asio::awaitable<page::BrowserMessage> read() override {
    using Kind = page::BrowserMessage::Kind;
    page::BrowserMessage message;
    buffer_.clear();
    const auto [error, count] = co_await stream_.async_read(buffer_, kNoThrow);
    if (error) {
      // Only a page that leaves says so; what breaks off may come back.
      const auto code = stream_.reason().code;
      const bool leaves = error == beast::websocket::error::closed &&
                          (code == beast::websocket::close_code::normal ||
                           code == beast::websocket::close_code::going_away);
      message.kind = leaves ? Kind::Closed : Kind::Lost;
      co_return message;
    }
    message.kind = stream_.got_text() ? Kind::Text : Kind::Binary;
    const auto* from = static_cast<const std::uint8_t*>(buffer_.data().data());
    message.bytes.assign(from, from + count);
    co_return message;
  }

  asio::awaitable<bool> write(BytesView bytes) override {
    const auto buffer = asio::buffer(bytes.data(), bytes.size());
    const auto [error, count] = co_await stream_.async_write(buffer, kNoThrow);
    co_return !error;
  }

  asio::awaitable<void> close() override {
    if (!stream_.is_open()) co_return;
    const beast::websocket::close_reason reason(beast::websocket::close_code::normal);
    co_await stream_.async_close(reason, kNoThrow);
  }

  void cut() override { beast::get_lowest_layer(stream_).close(); }
  std::string peer_address() const override { return peer_; }

 private:
  beast::websocket::stream<Below> stream_;
  beast::flat_buffer buffer_{wire::kMaxUpstreamBytes};
  const std::string peer_;
};

}  // namespace trocar::app
