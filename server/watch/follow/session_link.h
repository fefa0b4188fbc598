#pragma once

// A connection to a session that is there once the session's certificate is known: TCP, TLS, and
// the half code that join codes for this session begin with. Thread: that of its executor.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <optional>
#include <string>

#include "common/secure/join_code.h"
#include "common/secure/stream.h"
#include "common/wire/framing.h"
#include "server/watch/follow/sessions.h"

namespace trocar::follow {

class SessionLink {
 public:
  // `sessions` outlives this.
  SessionLink(asio::any_io_executor executor, Sessions& sessions);

  // Tries the session's own address, then others that it has named, where the certificate has to be
  // the one that has named them. Each try takes five seconds at most, TLS with it. False: why()
  // says what is wrong, in one line.
  asio::awaitable<bool> open(const SessionAddress& session);
  const std::string& why() const { return why_; }
  // Returns that of the certificate, once it is open.
  const secure::HalfCode& code() const { return code_; }

  // Reads one message without its length into `body`. False: the connection has ended.
  asio::awaitable<bool> read(Bytes& body);
  // `framed`: with its length; it lives until it is done.
  asio::awaitable<bool> write(BytesView framed);
  // Ends what is under way.
  void cut();

 private:
  asio::awaitable<bool> open_at(const SessionAddress& place);
  // `endpoint`: one of those that the place's name has.
  asio::awaitable<bool> try_at(const SessionAddress& place,
                               const asio::ip::tcp::endpoint& endpoint);

  asio::any_io_executor executor_;
  Sessions& sessions_;
  std::optional<secure::Stream> stream_;
  asio::steady_timer deadline_;
  bool is_cut_ = false;
  secure::HalfCode code_{};
  std::string why_;
};

}  // namespace trocar::follow
