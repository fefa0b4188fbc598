#pragma once

// One stream of bytes over TCP, with TLS or without. Operations are awaited on the socket's
// executor; one read and one write may be under way at the same time. Closing the socket ends
// both with an error.
//
// There is no closing handshake: the end of a session is said inside the encryption (Goodbye, Bye),
// so a stream that was cut is seen as such.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/no_throw.h"
#include "common/secure/datagram_channel.h"
#include "common/secure/tls.h"

namespace trocar::secure {

struct Transfer {
  boost::system::error_code error;
  std::size_t count = 0;
};

class Stream {
 public:
  using Socket = asio::ip::tcp::socket;
  enum class Greeting { Tls, Other, None };

  // `tls` null: without TLS.
  Stream(Socket socket, const TlsContext& tls);

  Socket& socket();
  bool has_tls() const { return content_.index() == 1; }

  // Looks at the peer's first bytes without taking them; None: it has sent nothing and is gone.
  asio::awaitable<Greeting> peek_greeting();
  asio::awaitable<boost::system::error_code> accept_tls();
  // With a CA the certificate must be of `host`, which lives until it is done.
  asio::awaitable<boost::system::error_code> begin_tls(const std::string& host);
  // The peer's certificate; empty before the handshake.
  Bytes peer_certificate_der();

  // The key of this session's datagrams, equal at both ends (RFC 8446 section 7.5); only with TLS,
  // after the handshake.
  std::optional<DatagramKey> datagram_key();

  asio::awaitable<Transfer> read_some(asio::mutable_buffer to);
  asio::awaitable<Transfer> read_all(asio::mutable_buffer to);
  // `buffers` live until it is done.
  asio::awaitable<Transfer> write_all(const std::vector<asio::const_buffer>& buffers);
  // For who has no coroutine: `done` is called on the socket's executor.
  using Done = std::function<void(boost::system::error_code, std::size_t)>;
  void read_some(asio::mutable_buffer to, Done done);
  void write_some(asio::const_buffer from, Done done);

 private:
  using TlsStream = asio::ssl::stream<Socket>;

  std::variant<Socket, TlsStream> content_;
};

// Words for a client's failed handshake: what is wrong, and what to do.
std::string describe_handshake_failure(const boost::system::error_code& error);
// True where the peer closed before the handshake was done: it may be busy, another try may help.
bool may_try_again(const boost::system::error_code& error);
bool is_tls_greeting(BytesView bytes);

}  // namespace trocar::secure
