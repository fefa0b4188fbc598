#pragma once

// HTTP over a connection, with TLS or without, until a deadline. Boost.Beast parses; bytes come and
// go through secure::Stream. Beast's own reading and writing is a template that takes half a minute
// to compile for each kind of stream and message.
//
// Thread: the one that runs the socket's executor.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <chrono>
#include <memory>
#include <string>

#include "common/secure/stream.h"

namespace trocar::monitoring {

using HttpRequest = boost::beast::http::request<boost::beast::http::string_body>;
using HttpResponse = boost::beast::http::response<boost::beast::http::string_body>;

// Operations are awaited by one coroutine, one at a time, and each returns its error.
class HttpStream {
 public:
  // `tls` null: without TLS.
  HttpStream(asio::ip::tcp::socket socket, const secure::TlsContext& tls);
  // An operation that is still under way after this span ends with an error, timed_out. The span
  // replaces the one before.
  void end_after(std::chrono::steady_clock::duration span);
  void end_never();

  // The stream below, to connect and for the handshake; it lasts as long as this one.
  secure::Stream& below();

  // Until the parser has the whole message, or only its header.
  template <bool is_request>
  asio::awaitable<boost::system::error_code> read(
      boost::beast::http::basic_parser<is_request>& parser, bool header_only = false);
  asio::awaitable<boost::system::error_code> write(const HttpRequest& request);
  asio::awaitable<boost::system::error_code> write(const HttpResponse& response);
  // Says that nothing more will be written.
  void shut_down();
  // The error of an operation, or that it came too late.
  boost::system::error_code reason(const boost::system::error_code& error) const;

 private:
  struct Below {
    secure::Stream stream;
    bool is_late = false;
  };

  asio::awaitable<boost::system::error_code> write_text(const std::string& text);

  std::shared_ptr<Below> below_;  // shared with the timer, whose end may wait to be told
  asio::steady_timer timer_;
  std::string unread_;
};

}  // namespace trocar::monitoring
