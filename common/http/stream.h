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
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/secure/stream.h"

namespace trocar::http {

using Fields = std::vector<std::pair<std::string, std::string>>;

struct Request {
  std::string method, target, body;
  Fields fields;
  bool is_old = false;  // HTTP/1.0
  bool keeps_alive = false;
  bool is_for_web_socket = false;

  // Whatever case the field's name has; nothing: there is none.
  std::optional<std::string_view> find(std::string_view name) const;
  std::string_view field(std::string_view name) const { return find(name).value_or(""); }
  std::string_view path() const { return std::string_view(target).substr(0, target.find('?')); }
};

struct Answer {
  unsigned status = 200;
  Fields fields;
  std::string body;
  std::optional<std::uint64_t> length;  // of a body that is written by itself
};

enum class Reading { Whole, Gone, Malformed, TooLong };

struct MessageLimits {
  std::uint32_t head_bytes = 8192;
  std::uint64_t body_bytes = 0;
};

// Operations are awaited by one coroutine, one at a time.
class Stream {
 public:
  // `tls` null: without TLS.
  Stream(asio::ip::tcp::socket socket, const secure::TlsContext& tls);
  // An operation that is still under way after this span ends with an error. The span replaces the
  // one before.
  void end_after(std::chrono::steady_clock::duration span);
  void end_never();
  // Ends what is under way.
  void cut();

  // Returns the stream below, to connect and for the handshake.
  secure::Stream& below();
  std::shared_ptr<secure::Stream> share_below();

  // TooLong: the body is, the head is known.
  asio::awaitable<Reading> read(Request& request, const MessageLimits& limits);
  asio::awaitable<Status> read(Answer& answer, const MessageLimits& limits);
  asio::awaitable<Status> write(const std::string& text);
  // False: the connection has ended. A question for the head alone gets no body.
  asio::awaitable<bool> write(const Request& question, const Answer& answer);
  asio::awaitable<bool> write(BytesView piece);
  // Says that nothing more will be written.
  void shut_down();
  // In words, or that it came too late.
  Error trouble(const boost::system::error_code& error) const;

 private:
  struct Below {
    secure::Stream stream;
    bool is_late = false;
  };

  template <typename Parser>
  asio::awaitable<boost::system::error_code> parse(Parser& parser);

  std::shared_ptr<Below> below_;  // shared with the timer, whose end may wait to be told
  asio::steady_timer timer_;
  std::string unread_;
};

}  // namespace trocar::http
