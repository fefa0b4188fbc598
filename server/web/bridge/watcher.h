#pragma once

// One person who watches through a browser: a WebSocket on one side, a connection of his own to the
// session on the other. The bridge reads no surface and keeps none.
//
//   browser --who joins--> Watcher --TLS, certificate against the code--> session
//           <-- Envelopes, one at a time -- Watcher <-- frames ----------
//           -- acknowledgements, pings, marks --> checked by kind --> session
//
// Nothing queues here. The next frame is read from the session when the browser's socket has taken
// the one before, and the session sends what its acknowledgements say that the browser can take:
// frames are skipped there, by their age, for this watcher alone.
//
// Bounds: one message each way, 16 MiB down and 64 KiB up; 5 s to say who joins, as many to reach
// the session. What the browser may say is acknowledgements, pings, requests for keyframes, marks,
// the full solution and what belongs to a lesson; anything else ends its session. The server checks
// roles, as of everybody.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/secure/join_code.h"
#include "common/secure/stream.h"
#include "common/wire/framing.h"
#include "server/session/access/try_limiter.h"
#include "server/web/bridge/browser_socket.h"
#include "server/web/bridge/join_request.h"

namespace trocar::proto {
class Envelope;
}

namespace trocar::bridge {

struct SessionAddress {
  std::string name;  // "HOST:PORT", as links have it
  std::string host;
  std::uint16_t port = 0;
};

struct BridgeCounters {
  std::uint64_t joins = 0;        // that reached a session
  std::uint64_t refused = 0;      // by the bridge: form, code, too many tries
  std::uint64_t wrong_codes = 0;  // by bridge or session
  std::uint64_t unreachable = 0;  // sessions
  std::uint64_t messages_down = 0, bytes_down = 0;
  std::uint64_t messages_up = 0, bytes_up = 0;
  std::size_t watchers = 0;  // now
};

// All watchers of a program share this. Thread: that of its I/O context.
class Bridge {
 public:
  explicit Bridge(std::vector<SessionAddress> sessions);

  const SessionAddress* find_session(const std::string& name) const;
  const secure::TlsContext& tls() const { return tls_; }
  // The half code of a certificate takes 40 ms to find: it is kept for those that were seen.
  secure::HalfCode code_of(BytesView der);

  access::TryLimiter limiter;
  BridgeCounters counters;

 private:
  std::vector<SessionAddress> sessions_;
  secure::TlsContext tls_;
  std::map<Bytes, secure::HalfCode> known_;
};

class Watcher : public std::enable_shared_from_this<Watcher> {
 public:
  // `bridge` outlives this.
  Watcher(std::unique_ptr<BrowserSocket> browser, Bridge& bridge);

  // From the first message to the end; the caller keeps this alive until then.
  asio::awaitable<void> run();
  void cut();

 private:
  asio::awaitable<bool> read_join();
  asio::awaitable<bool> reach_session();
  asio::awaitable<bool> secure_session(const SessionAddress& session);
  asio::awaitable<bool> say_hello();
  asio::awaitable<void> refuse(int reason, std::string text);
  asio::awaitable<void> relay_down();
  asio::awaitable<void> relay_up();
  asio::awaitable<void> end_at(std::chrono::steady_clock::time_point deadline);
  asio::awaitable<bool> send_up(BytesView envelope);
  // False: the browser may not say this.
  bool may_pass(BytesView envelope) const;
  void note_refusal(BytesView envelope);
  void begin_deadline(std::chrono::seconds time);

  std::unique_ptr<BrowserSocket> browser_;
  Bridge& bridge_;
  JoinRequest request_;
  std::optional<secure::Stream> session_;
  asio::steady_timer deadline_;
  asio::steady_timer up_ended_;  // cancelled when relay_up() has ended
  bool is_up_running_ = false, is_reached_ = false, is_cut_ = false;
  std::string why_;
  Bytes body_, upward_;
};

}  // namespace trocar::bridge
