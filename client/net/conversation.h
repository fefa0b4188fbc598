#pragma once

// A client talks over one connection to its server after the other: Hello and pings out, messages
// in, datagrams beside them. Thread: the Asio thread.
//
//   begin() -> read(), which returns when the connection has ended -> cut() -> await_end() -> ...

#include "common/base/asio.h"  // before Boost: see there

#include <array>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/net/comeback.h"
#include "client/net/datagram_path.h"
#include "client/net/hand_messages.h"
#include "client/net/inbound.h"
#include "client/net/net_figures.h"
#include "client/net/server_link.h"
#include "common/base/spsc_queue.h"
#include "common/wire/framing.h"
#include "common/wire/server_clock.h"
#include "proto/wire.pb.h"

namespace trocar::net {

// A conversation is part of a session, whose it uses.
struct ConversationParts {
  asio::io_context& context;
  const NetSourceOptions& options;
  ServerLink& link;
  const Comeback& comeback;
  Inbound& inbound;
  SpscQueue<std::shared_ptr<const proto::Envelope>>& outbound;
  NetFigures& figures;
};

struct ConversationEvents {
  std::function<void(const proto::Welcome&)> welcome;
  // The connection is no good any more; there may be another.
  std::function<void(std::string)> broken;
  std::function<void(replica::CloseKind, std::string)> over;
  std::function<void(std::exception_ptr)> failed;
};

class Conversation {
 public:
  using Clock = std::chrono::steady_clock;

  Conversation(const ConversationParts& parts, ConversationEvents events);

  void begin();
  asio::awaitable<void> read();
  // Looks at what waits to be sent.
  void wake() { wake_timer_.cancel(); }
  // Says it, then nothing more.
  void say_bye(const std::string& reason);
  // Ends what is under way; await_end() waits for that.
  void cut();
  asio::awaitable<void> await_end();

  bool is_on() const { return is_on_; }
  bool is_closing() const { return is_closing_; }
  // Something other than a Pong came over this connection.
  bool has_heard() const { return has_heard_; }

 private:
  wire::SharedBytes encode_hello() const;
  asio::awaitable<bool> read_exactly(std::uint8_t* to, std::size_t count);
  bool make_room_for(std::span<const std::uint8_t, wire::kHeaderBytes> header);
  std::shared_ptr<const proto::Envelope> pop_message();
  void note_pong(const proto::Pong& pong);
  void heed(const proto::Envelope& message);
  asio::awaitable<void> deliver(std::shared_ptr<const proto::Envelope> message, std::size_t bytes);
  void end_if_final(const proto::Envelope& message);
  void begin_datagrams();
  void deliver_datagram(std::shared_ptr<const proto::Envelope> message, std::size_t bytes);
  asio::awaitable<void> write();
  void take_outbound();
  asio::awaitable<void> ping();
  void queue_ping();
  void check_silence();
  asio::awaitable<void> serve_hands();

  const ConversationParts parts_;
  const ConversationEvents events_;
  std::optional<HandMessages> hands_;
  std::unique_ptr<DatagramPath> datagrams_;  // null: the stream carries everything
  wire::ServerClock clock_;
  asio::steady_timer room_timer_, ping_timer_, wake_timer_, hands_timer_;
  std::vector<wire::SharedBytes> control_;  // Hello, Ping, Bye: at most one of each
  std::vector<wire::SharedBytes> in_flight_;
  int talkers_ = 0;  // coroutines of this connection besides the reader
  bool is_on_ = false, is_closing_ = false;
  bool is_stalled_ = false;  // the render thread takes nothing
  bool is_barrier_ = false;  // answers must arrive from here on
  bool has_heard_ = false, is_ping_queued_ = false;
  Clock::time_point last_heard_{}, last_datagram_{};
  Bytes body_;
};

}  // namespace trocar::net
