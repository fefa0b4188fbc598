#pragma once

// One person at a browser: he says who joins, and then either shares a connection to the session
// with all who only watch (seat.h), or, as one who leads or holds instruments, has one of his own:
//
//   browser --who joins--> Watcher --TLS, certificate against the code--> session
//           <-- Envelopes, one at a time -- Watcher <-- frames ----------
//           -- acknowledgements, marks, tools --> checked by kind --> session
//
// Nothing queues on the own connection. The next frame is read from the session when the browser's
// socket has taken the one before, and the session sends what its acknowledgements say that the
// browser can take: frames are skipped there, by their age, for this watcher alone.
//
// Bounds: one message each way, 16 MiB down and 64 KiB up; 5 s to say who joins, as many to reach
// the session. What the browser may say is acknowledgements, pings, requests for keyframes, marks,
// what belongs to a lesson and, if its role has tools, where these are; anything else ends its
// session. The server checks roles, as of everybody.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <memory>
#include <string>

#include "server/watch/follow/session_link.h"
#include "server/watch/page/bridge.h"
#include "server/watch/page/browser_socket.h"
#include "server/watch/page/join_request.h"
#include "server/watch/page/seat.h"

namespace trocar::page {

class Watcher : public std::enable_shared_from_this<Watcher> {
 public:
  // `bridge` outlives this.
  Watcher(std::unique_ptr<BrowserSocket> browser, Bridge& bridge);

  // From the first message to the end; the caller keeps this alive until then.
  asio::awaitable<void> run();
  void cut();

 private:
  asio::awaitable<bool> read_join();
  asio::awaitable<void> watch_with_others(const follow::SessionAddress& session);
  asio::awaitable<void> watch_alone(const follow::SessionAddress& session);
  asio::awaitable<bool> reach_session(const follow::SessionAddress& session);
  asio::awaitable<void> refuse(wire::EndReason reason, std::string text);
  asio::awaitable<void> relay_down();
  asio::awaitable<void> relay_up();
  asio::awaitable<bool> send_up(BytesView envelope);
  void note_refusal(BytesView envelope);

  std::unique_ptr<BrowserSocket> browser_;
  Bridge& bridge_;
  JoinRequest request_;
  std::shared_ptr<Seat> seat_;  // of who shares
  follow::SessionLink link_;    // of who does not
  asio::steady_timer join_deadline_;
  asio::steady_timer up_ended_;  // cancelled when relay_up() has ended
  bool is_up_running_ = false, is_cut_ = false;
  std::string why_;
  Bytes body_, upward_;
};

}  // namespace trocar::page
