#pragma once

// One connection to a session for all who only watch it through this program; whoever leads or
// holds instruments is alone on his. What is for everybody crosses it once (GuestMessage in
// proto/wire.proto) and is shown to each seat as its browser takes it (server/watch/crowd/show.h):
// to that, a seat is a connection, by its number.
//
//   session --frames, events--> Carrier --> Show --what this one can take--> seats
//           --for one guest--> Carrier ------------------------------------> seat
//           <--acknowledgements, pings, what a guest says-- Carrier <------- seats
//
// It begins with the first seat and ends with the last, or when the session closes it: then every
// seat is told, and the next one begins another. Bounds: what goes up waits for room, one message
// of each seat. The browser may send 600 messages a second. Thread: that of its executor.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "server/session/net/connections.h"
#include "server/watch/crowd/show.h"
#include "server/watch/follow/conversation.h"
#include "server/watch/page/page_counters.h"

namespace trocar::proto {
class Goodbye;
class GuestMessage;
}  // namespace trocar::proto

namespace trocar::page {

// One for whom a carrier brings messages.
class Carried {
 public:
  virtual ~Carried() = default;
  // Takes a message for this one alone.
  virtual void take(const proto::Envelope& message) = 0;
  // Hears that nothing more comes for this one.
  virtual void finish_after_words() = 0;
  // Queues a framed message; false: there is no room.
  virtual bool tell(const wire::SharedBytes& framed) = 0;
  virtual std::size_t waiting_bytes() const = 0;
  // Hears that its browser has to begin anew.
  virtual void cut_off(const std::string& why) = 0;
  // Hears that the carrier has ended.
  virtual void lose() = 0;
  // Returns its place in the session, or none yet.
  virtual std::uint32_t slot() const = 0;
};

class Carrier final : private net::Connections,
                      private crowd::Show,
                      public std::enable_shared_from_this<Carrier> {
 public:
  // `sessions` and `counters` outlive this.
  Carrier(asio::any_io_executor executor, follow::Sessions& sessions, PageCounters& counters,
          follow::SessionAddress session);
  ~Carrier() override;
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
  // Takes what a seat that is welcome says, after such a wait. It may be cut off for that.
  asio::awaitable<bool> heed_page(std::uint32_t number, BytesView envelope);

 private:
  enum class State { Reaching, Open, Ended };

  asio::awaitable<void> run();
  bool take_any(const proto::Envelope& message, const Bytes& body);
  void take_for_guest(const proto::GuestMessage& guest);
  void say_goodbye(const proto::Goodbye& goodbye);
  void say_for(std::uint32_t number, BytesView envelope, bool is_last);
  void attend();
  void end();

  std::optional<replication::Ending> heed(replication::Viewer& who,
                                          const proto::Envelope& message) override;
  std::optional<replication::Ending> heed_samples(const replication::Viewer&,
                                                  const proto::ClientDatagram&) override {
    return std::nullopt;  // there are no datagrams
  }
  void note_shown(const replication::Viewer& who, const proto::FrameAck& ack) override;
  std::uint64_t server_time_us() const override;
  void forget(const replication::Viewer& who, const replication::Ending* ending) override;
  net::ConnectionId but(const proto::Envelope& message) const override;

  bool send(net::ConnectionId seat, wire::SharedBytes framed) override;
  bool has_datagrams(net::ConnectionId) const override { return false; }
  bool send_datagram(net::ConnectionId, BytesView) override { return false; }
  std::size_t outstanding_bytes(net::ConnectionId seat) const override;
  std::string peer_address(net::ConnectionId) const override { return {}; }
  void close_after_flush(net::ConnectionId, wire::SharedBytes) override {}  // see forget()
  void close(net::ConnectionId) override {}

  asio::any_io_executor executor_;
  follow::Sessions& sessions_;
  PageCounters& counters_;
  const follow::SessionAddress session_;
  follow::Conversation conversation_;
  State state_ = State::Reaching;
  bool is_carrying_ = false;  // a guest is welcome
  std::string why_;
  std::map<net::ConnectionId, Carried*> seats_;
  std::uint32_t next_number_ = 1;
  asio::steady_timer changed_;  // cancelled to wake who waits for it to be open
  asio::steady_timer attention_;
};

}  // namespace trocar::page
