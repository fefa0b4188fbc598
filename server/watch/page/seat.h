#pragma once

// One who watches over a carrier (carrier.h), which many share. The session has let him in by name
// and code as anybody, and says when he has to go.
//
// To the browser: what he is told, in order, and the frames that it can take, by its socket and its
// acknowledgements.
//
// Bounds: 1 MiB of messages that wait, or four of the largest; beyond that the connection is cut,
// and the page comes back to a fresh picture. Thread: that of the browser's executor.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <deque>
#include <memory>
#include <string>

#include "common/http/web_socket.h"
#include "server/watch/page/bridge.h"
#include "server/watch/page/join_request.h"
#include "server/watch/page/page_messages.h"

namespace trocar::page {

class Seat final : public Carried, public std::enable_shared_from_this<Seat> {
 public:
  // All references outlive finish().
  Seat(http::WebSocket& browser, Bridge& bridge, const JoinRequest& request);

  // Until he is refused, leaves, or has to go; the browser has been told why by then.
  asio::awaitable<void> run(const follow::SessionAddress& session);
  // After the browser's connection was cut.
  asio::awaitable<void> finish();
  void cut();
  const std::string& why() const { return why_; }

  void take(const proto::Envelope& message) override;
  void finish_after_words() override;
  bool tell(const wire::SharedBytes& framed) override;
  std::size_t waiting_bytes() const override { return waiting_bytes_; }
  void cut_off(const std::string& why) override;
  void lose() override;
  std::uint32_t slot() const override { return slot_; }

 private:
  static constexpr std::uint32_t kNoSlot = ~0u;
  static constexpr std::size_t kMostWaitingBytes = 1024 * 1024;

  void forget_last_try();
  asio::awaitable<bool> join(const follow::SessionAddress& session);
  asio::awaitable<bool> say_hello();
  asio::awaitable<void> leave_carrier();
  asio::awaitable<void> write_down();
  asio::awaitable<void> read_up();
  void refuse(wire::EndReason reason, const std::string& text);
  void wake() { news_.cancel(); }

  http::WebSocket& browser_;
  Bridge& bridge_;
  const JoinRequest& request_;
  std::shared_ptr<Carrier> carrier_;
  std::uint32_t number_ = 0, slot_ = kNoSlot;
  bool is_welcome_ = false;
  bool is_last_ = false;  // nothing is to follow what waits
  bool is_lost_ = false, is_cut_ = false, is_up_running_ = false;
  std::deque<wire::SharedBytes> waiting_;
  std::size_t waiting_bytes_ = 0;  // with what is being written
  std::size_t most_waiting_ = kMostWaitingBytes;
  asio::steady_timer news_, up_ended_;
  std::string why_;
  std::shared_ptr<SessionUse> use_;  // of the session, once it is reached
  Deeds deeds_;
};

}  // namespace trocar::page
