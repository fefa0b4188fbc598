#pragma once

// A relay's own place in the session: it joins the server as one observer, hears everything that
// watchers are told, and acknowledges each frame.
//
//   start -> Hello -> Welcome -> messages, each handed on in order
//      \ lost (broken, or silent for 3 s): again after 0.2 s, then longer pauses of up to 2 s
//      \ over: the server has said Goodbye for good, or there was no way back for too long
//
// It comes back with the token of the Welcome before, and to the address that it was given alone:
// addresses that a Welcome names may be its own, and then it would watch itself. A name that is
// taken gets a number. What goes up waits for the socket: at most 256 KiB, more of it is left out.
// Thread: that of its executor.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <deque>
#include <memory>
#include <string>

#include "common/secure/join_code.h"
#include "common/wire/framing.h"
#include "server/session/replication/validation.h"
#include "server/watch/follow/server_clock.h"
#include "server/watch/follow/session_link.h"
#include "server/watch/follow/upstream.h"

namespace trocar::proto {
class Envelope;
class Goodbye;
class Welcome;
}  // namespace trocar::proto

namespace trocar::follow {

struct UplinkOptions {
  SessionAddress server;
  secure::JoinCode code;
  std::string name;                                    // 1 to 29 bytes, so that a number fits
  std::chrono::milliseconds reach_deadline{15'000};    // for the first Welcome
  std::chrono::milliseconds return_deadline{600'000};  // for each later one
  std::chrono::milliseconds silence{3000};
};

class Uplink final : public Upstream {
 public:
  Uplink(asio::any_io_executor executor, UplinkOptions options);
  ~Uplink() override;

  void start(UpstreamEvents events) override;
  // Says Bye where somebody listens, and ends what is under way.
  void stop() override;
  void say(const proto::Envelope& message) override;

  std::string name() const override { return options_.server.name; }
  bool is_welcome() const override { return is_welcome_; }
  std::uint64_t server_time_us(std::uint64_t now_us) const override { return clock_.at(now_us); }
  std::uint64_t bytes_received() const override { return sessions_.bytes; }
  std::uint64_t returns() const override { return returns_; }

 private:
  asio::awaitable<void> run();
  asio::awaitable<void> talk();
  asio::awaitable<void> read_all();
  asio::awaitable<void> write_all();
  asio::awaitable<void> ping_often();
  void spawn_talker(asio::awaitable<void> work);
  void say_hello();
  void say_waiting();
  // False: nothing more is to be read.
  bool take(const Bytes& body);
  bool take_goodbye(const proto::Goodbye& goodbye);
  void take_welcome(const proto::Welcome& welcome);
  void end(replication::EndReason reason, const std::string& text);
  void cut();
  std::string name_there() const;

  asio::any_io_executor executor_;
  const UplinkOptions options_;
  UpstreamEvents events_;
  Sessions sessions_;
  std::unique_ptr<SessionLink> link_;
  ServerClock clock_;
  std::deque<wire::SharedBytes> upward_;
  std::size_t upward_bytes_ = 0;
  std::string token_, why_;
  bool is_welcome_ = false, was_welcome_ = false, is_talking_ = false, is_over_ = false;
  bool has_said_waiting_ = false;
  int talkers_ = 0, number_ = 1;
  std::uint64_t returns_ = 0, heard_ns_ = 0, deadline_ns_ = 0;
  asio::steady_timer pause_, has_mail_, next_ping_, talkers_ended_;
};

}  // namespace trocar::follow
