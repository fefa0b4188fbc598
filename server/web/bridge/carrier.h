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
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "server/web/bridge/bridge.h"
#include "server/web/bridge/server_clock.h"
#include "server/web/bridge/session_copy.h"
#include "server/web/bridge/session_link.h"

namespace trocar::proto {
class Envelope;
class Goodbye;
class Welcome;
}  // namespace trocar::proto

namespace trocar::bridge {

class Seat;

class Carrier : public std::enable_shared_from_this<Carrier> {
 public:
  // `bridge` outlives this.
  Carrier(asio::any_io_executor executor, Bridge& bridge, SessionAddress session);
  ~Carrier();
  void start();

  // False: it has ended, and why() says why.
  asio::awaitable<bool> reach();
  bool has_ended() const { return state_ == State::Ended; }
  const std::string& why() const { return why_; }
  const secure::HalfCode& code() const { return link_.code(); }

  // `seat` is told what comes until remove(). Returns its number.
  std::uint32_t add(Seat& seat);
  void remove(std::uint32_t number);
  // Waits for room. `envelope` empty: nothing but that this was the last. False: it has ended.
  asio::awaitable<bool> say(std::uint32_t number, BytesView envelope, bool is_last);

  // Other addresses of the session, as its Welcome to a seat names them.
  void note_further(const proto::Welcome& welcome);

  SessionCopy& copy() { return copy_; }
  const ServerClock& clock() const { return clock_; }

 private:
  enum class State { Reaching, Open, Ended };

  void spawn(asio::awaitable<void> work);
  asio::awaitable<void> run();
  asio::awaitable<void> read_all();
  asio::awaitable<void> write_all();
  asio::awaitable<void> ping_often();
  bool take(const Bytes& body);
  void say_goodbye(const proto::Goodbye& goodbye);
  bool spread(const proto::Envelope& message, const wire::SharedBytes& framed);
  void queue(const proto::Envelope& message);
  void end();

  asio::any_io_executor executor_;
  Bridge& bridge_;
  const SessionAddress session_;
  SessionLink link_;
  State state_ = State::Reaching;
  bool is_carrying_ = false;  // a guest is welcome
  std::string why_;
  SessionCopy copy_;
  ServerClock clock_;
  std::map<std::uint32_t, Seat*> seats_;
  std::uint32_t next_number_ = 1;
  std::deque<wire::SharedBytes> upward_;
  std::size_t upward_bytes_ = 0;
  asio::steady_timer changed_;   // cancelled to wake who waits for it to be open, or for room
  asio::steady_timer has_mail_;  // cancelled to wake the writer
  asio::steady_timer next_ping_;
};

}  // namespace trocar::bridge
