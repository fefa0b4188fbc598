#pragma once

// One accepted TCP connection: a reader coroutine that cuts the stream into frames, a writer
// coroutine that empties a bounded outbox. Used by TcpServer only.
//
//   Greeting --TLS is there--> Open       (without TLS it is Open at once)
//      \--no TLS, failure, deadline--> Closed, and nobody above has heard of it
//   Open --close_after_flush--> Draining --all sent--> (send side shut) --peer closes--> Closed
//     \--------------------------close, error, deadline------------------------------->/
//
// While Draining the peer's bytes are read and thrown away: closing a socket with unread bytes
// makes the kernel send a reset, and the peer could lose the last words that are on their way.
// The reader takes what the peer had said before it went to its end, also where writing fails.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <deque>
#include <functional>
#include <memory>
#include <vector>

#include "common/secure/stream.h"
#include "server/session/net/connections.h"

namespace trocar::net {

class Connection : public std::enable_shared_from_this<Connection> {
 public:
  using Clock = std::chrono::steady_clock;

  // The server hears of a connection through these; they are called on the I/O thread.
  struct Events {
    std::function<void()> open;  // it can be written to from here on
    std::function<void(BytesView)> message;
    std::function<void(ConnectionFault)> fault;
    std::function<void(std::size_t)> bytes_written;
    std::function<void()> closed;
  };

  // `plain_reply`: for a peer that begins without TLS where TLS is wanted; may be null.
  Connection(secure::Stream stream, std::string peer_address, std::uint32_t max_message_bytes,
             std::size_t outbox_bytes, wire::SharedBytes plain_reply);

  void start(Events events);

  bool send(wire::SharedBytes frame);
  std::size_t outstanding_bytes() const { return outstanding_; }
  const std::string& peer_address() const { return peer_address_; }
  std::optional<secure::DatagramKey> datagram_key() { return stream_.datagram_key(); }
  // Its TLS is not there yet.
  bool is_greeting() const { return state_ == State::Greeting; }
  void close_after_flush(wire::SharedBytes last_words, Clock::time_point deadline);
  void close();
  // Reports `fault` once and stops delivering; the handler closes.
  void fail(ConnectionFault fault);

  // Checks time limits; called a few times per second.
  void check_deadlines(Clock::time_point now, Clock::duration idle);

 private:
  enum class State { Greeting, Open, Failed, Draining, Closed };

  asio::awaitable<void> greet();
  asio::awaitable<void> reply_plainly();
  void begin();
  asio::awaitable<void> read_frames();
  asio::awaitable<void> write_outbox();
  // Delivers every complete frame in the buffer; false when nothing more is to be read.
  bool deliver_frames();
  void discard_outbox();
  void stop_writing();

  secure::Stream stream_;
  const std::string peer_address_;
  asio::steady_timer outbox_changed_;  // never expires; cancelled to wake the writer
  const std::uint32_t max_message_bytes_;
  const std::size_t outbox_bytes_;
  const wire::SharedBytes plain_reply_;
  Events events_;
  State state_ = State::Greeting;
  bool is_peer_gone_ = false;  // nothing more can be written
  bool first_message_seen_ = false;
  Clock::time_point last_message_ = Clock::now();
  Clock::time_point drain_deadline_{};
  Bytes inbound_;  // received and not yet delivered: [begin_, end_)
  std::size_t begin_ = 0, end_ = 0;
  std::deque<wire::SharedBytes> outbox_;
  std::vector<wire::SharedBytes> in_flight_;
  std::size_t outstanding_ = 0;  // bytes in outbox_ and in_flight_
};

}  // namespace trocar::net
