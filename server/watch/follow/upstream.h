#pragma once

// A relay has its session from the session's server, or from others that pass the session on.
// Thread: that of the relay's executor.

#include <cstdint>
#include <functional>
#include <string>

#include "common/wire/framing.h"
#include "common/wire/session_messages.h"

namespace trocar::proto {
class Envelope;
class Welcome;
}  // namespace trocar::proto

namespace trocar::follow {

struct UpstreamEvents {
  // Everything comes anew, for the first time or again.
  std::function<void(const proto::Welcome&)> welcome;
  // An error ends the connection, which is then made again.
  std::function<Status(const proto::Envelope&, const wire::SharedBytes& framed)> message;
  std::function<void(const std::string& why)> lost;
  std::function<void(wire::EndReason reason, const std::string& text)> over;
};

class Upstream {
 public:
  virtual ~Upstream() = default;

  // `events` are called on the executor's thread; none after stop().
  virtual void start(UpstreamEvents events) = 0;
  // Takes leave where somebody listens, and ends what is under way.
  virtual void stop() = 0;
  // Queues a message for the server; nothing happens while there is no connection.
  virtual void say(const proto::Envelope& message) = 0;

  // "HOST:PORT", or other words for people.
  virtual std::string name() const = 0;
  virtual bool is_welcome() const = 0;
  // The server's clock at this time of ours, in us; 0: not known yet.
  virtual std::uint64_t server_time_us(std::uint64_t now_us) const = 0;
  virtual std::uint64_t bytes_received() const = 0;
  virtual std::uint64_t returns() const = 0;
};

}  // namespace trocar::follow
