#pragma once

// A conversation is what is said over one connection to a session, both ways.
//
//   open --> talk --messages, in order--> take()
//            say --queue--> session, pings among it --pongs--> the server's clock
//
// It may be opened again when it has ended; the clock is then learned anew. What goes up waits for
// the socket, kMostUpwardBytes of it: more is left out, and who asks for room first waits for that.
// Thread: that of its executor. It outlives what it is awaited for.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <deque>
#include <functional>
#include <optional>
#include <string>

#include "common/wire/framing.h"
#include "common/wire/server_clock.h"
#include "server/watch/follow/session_link.h"

namespace trocar::proto {
class Envelope;
}

namespace trocar::follow {

struct ConversationOptions {
  std::chrono::milliseconds ping_interval{1000};
  std::chrono::nanoseconds silence{0};  // ends it; 0: none does
};

class Conversation {
 public:
  static constexpr std::size_t kMostUpwardBytes = 256 * 1024;
  // `body`: the message as it came. False: nothing more is to be read.
  using Take = std::function<bool(const proto::Envelope& message, const Bytes& body)>;

  // `sessions` outlives this.
  Conversation(asio::any_io_executor executor, Sessions& sessions, ConversationOptions options,
               Take take);

  // Forgets what waits. False: why() says what is wrong, in one line.
  asio::awaitable<bool> open(const SessionAddress& session);
  // Until one side ends it. Messages are handed on, but for answers to pings.
  asio::awaitable<void> talk();
  // Nothing is said where it is not open.
  void say(const proto::Envelope& message) { say(wire::encode_envelope(message)); }
  void say(wire::SharedBytes framed);
  // False: it has ended.
  asio::awaitable<bool> await_room();
  // Begins to ask for the server's clock: the session hears of nobody before Hello.
  void begin_pings();
  // Says what waits and then ends.
  void finish();
  // Ends at once.
  void cut();
  void explain(std::string why) { why_ = std::move(why); }

  const std::string& why() const { return why_; }
  // Returns that of the certificate, once it is open.
  const secure::HalfCode& code() const { return link_->code(); }
  const wire::ServerClock& clock() const { return clock_; }

 private:
  asio::awaitable<void> write_all();
  asio::awaitable<void> watch_time();
  asio::awaitable<void> read_all();
  void spawn_talker(asio::awaitable<void> work);
  bool heed(const Bytes& body);

  asio::any_io_executor executor_;
  Sessions& sessions_;
  const ConversationOptions options_;
  const Take take_;
  std::optional<SessionLink> link_;  // empty: not opened yet
  wire::ServerClock clock_;
  std::deque<wire::SharedBytes> upward_;
  std::size_t upward_bytes_ = 0;
  std::string why_;
  bool is_open_ = false, is_finishing_ = false, is_pinging_ = false;
  int talkers_ = 0;
  std::uint64_t heard_ns_ = 0;
  asio::steady_timer has_room_, has_mail_, next_ping_, talkers_ended_;  // cancelled to wake
};

}  // namespace trocar::follow
