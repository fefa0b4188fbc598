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
#include <memory>
#include <string>

#include "common/secure/join_code.h"
#include "common/wire/framing.h"
#include "common/wire/session_messages.h"
#include "server/watch/follow/conversation.h"
#include "server/watch/follow/follower.h"

namespace trocar::proto {
class Envelope;
class Goodbye;
}  // namespace trocar::proto

namespace trocar::follow {

struct UplinkOptions {
  SessionAddress server;
  secure::JoinCode code;
  std::string name;  // 1 to 29 bytes, so that a number fits
};

class Uplink final : public Follower {
 public:
  Uplink(asio::any_io_executor executor, UplinkOptions options);
  ~Uplink() override;

  void start(UpstreamEvents events) override;
  // Says Bye where somebody listens, and ends what is under way.
  void stop() override;
  void say(const proto::Envelope& message) override { conversation_.say(message); }

  std::string name() const override { return options_.server.name; }
  std::uint64_t server_time_us(std::uint64_t now_us) const override {
    return conversation_.clock().at(now_us);
  }
  std::uint64_t bytes_received() const override { return sessions_.bytes; }

 private:
  asio::awaitable<void> run();
  void cut() override { conversation_.cut(); }
  void say_hello();
  void say_waiting();
  // False: nothing more is to be read.
  bool take(const proto::Envelope& message, const Bytes& body);
  bool take_goodbye(const proto::Goodbye& goodbye);
  std::string name_there() const;

  asio::any_io_executor executor_;
  const UplinkOptions options_;
  Sessions sessions_;
  Conversation conversation_;
  std::string token_;
  bool has_said_waiting_ = false;
  int number_ = 1;
  asio::steady_timer pause_;
};

}  // namespace trocar::follow
