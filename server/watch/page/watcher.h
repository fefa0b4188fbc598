#pragma once

// One person at a browser: he says who joins, and then has a seat (seat.h) at the connection to the
// session that all who only watch share, or, as one who leads or holds instruments, at one of his
// own.
//
// Bounds: 5 s to say who joins, as many to reach the session. What the browser may say is
// acknowledgements, pings, requests for keyframes, marks, what belongs to a lesson and, if its role
// has tools, where these are; anything else ends its session. The server checks roles, as of
// everybody.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <memory>
#include <string>

#include "common/http/web_socket.h"
#include "server/watch/page/bridge.h"
#include "server/watch/page/join_request.h"
#include "server/watch/page/seat.h"

namespace trocar::page {

class Watcher : public std::enable_shared_from_this<Watcher> {
 public:
  // `bridge` outlives this.
  Watcher(std::unique_ptr<http::WebSocket> browser, Bridge& bridge);

  // From the first message to the end; the caller keeps this alive until then.
  asio::awaitable<void> run();
  void cut();

 private:
  asio::awaitable<bool> read_join();
  asio::awaitable<void> watch(const follow::SessionAddress& session);
  // False: an observer finds no place; he has been told.
  asio::awaitable<bool> find_place(const std::string& address);
  asio::awaitable<void> refuse(wire::EndReason reason, std::string text);

  std::unique_ptr<http::WebSocket> browser_;
  Bridge& bridge_;
  JoinRequest request_;
  std::shared_ptr<Seat> seat_;
  asio::steady_timer join_deadline_;
  bool is_cut_ = false;
  std::string why_;
};

}  // namespace trocar::page
