#pragma once

// One connection to a session for all who only watch it through this program. What is for everybody
// crosses it once (GuestMessage in proto/wire.proto) and is kept in a copy of the session, from
// which each seat is given what its browser can take.
//
//   session --frames, events--> Carrier --> SessionCopy --newest frame, by each one's own base-->
//   seats
//           --for one guest--> Carrier -----------------------------------------------------> seat
//           <--acknowledgements, pings, what a guest says-- Carrier <-------------------------
//           seats
//
// It begins with the first seat and ends with the last, or when the session closes it: then every
// seat is told, and the next one begins another. Bounds: what goes up waits for room, one message
// of each seat. Thread: that of its executor.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "server/watch/follow/conversation.h"
#include "server/watch/follow/session_copy.h"
#include "server/watch/page/page_counters.h"

namespace trocar::proto {
class Envelope;
class Goodbye;
class Welcome;
}  // namespace trocar::proto

namespace trocar::page {

// One for whom a carrier brings messages.
class Carried {
 public:
  virtual ~Carried() = default;
  // Takes a message for this one alone.
  virtual void take(BytesView envelope, bool is_last) = 0;
  // Hears a message that is for everybody.
  virtual void hear(follow::News news, const wire::SharedBytes& framed) = 0;
  // Hears that the carrier has ended.
  virtual void lose() = 0;
  // Returns its place in the session, or none yet.
  virtual std::uint32_t slot() const = 0;
};

class Carrier : public std::enable_shared_from_this<Carrier> {
 public:
  // `sessions` and `counters` outlive this.
  Carrier(asio::any_io_executor executor, follow::Sessions& sessions, PageCounters& counters,
          follow::SessionAddress session);
  ~Carrier();
  void start();

  // False: it has ended, and why() says why.
  asio::awaitable<bool> reach();
  bool has_ended() const { return state_ == State::Ended; }
  const std::string& why() const { return why_; }
  const secure::HalfCode& code() const { return conversation_.code(); }

  // `seat` is told what comes until remove(). Returns its number.
  std::uint32_t add(Carried& seat);
  void remove(std::uint32_t number);
  // Waits for room. `envelope` empty: nothing but that this was the last. False: it has ended.
  asio::awaitable<bool> say(std::uint32_t number, BytesView envelope, bool is_last);

  // Other addresses of the session, as its Welcome to a seat names them.
  void note_further(const proto::Welcome& welcome);

  follow::SessionCopy& copy() { return copy_; }
  const wire::ServerClock& clock() const { return conversation_.clock(); }

 private:
  enum class State { Reaching, Open, Ended };

  asio::awaitable<void> run();
  bool take(const proto::Envelope& message, const Bytes& body);
  void say_goodbye(const proto::Goodbye& goodbye);
  bool spread(const proto::Envelope& message, const wire::SharedBytes& framed);
  void end();

  asio::any_io_executor executor_;
  follow::Sessions& sessions_;
  PageCounters& counters_;
  const follow::SessionAddress session_;
  follow::Conversation conversation_;
  State state_ = State::Reaching;
  bool is_carrying_ = false;  // a guest is welcome
  std::string why_;
  follow::SessionCopy copy_;
  std::map<std::uint32_t, Carried*> seats_;
  std::uint32_t next_number_ = 1;
  asio::steady_timer changed_;  // cancelled to wake who waits for it to be open
};

}  // namespace trocar::page
