#pragma once

// One who watches over a connection that many share. The session has let him in by name and code as
// anybody, and says when he has to go; the picture comes from the carrier's copy.
//
// To the browser: what he is told, in order, then the newest frame, as a difference from the last
// that this browser was given. Frames never queue: while the socket is busy, or the browser's
// acknowledgements say that frames reach it late, they are skipped, for this one alone. Between
// frames, a part of the fine surface at a time.
//
// Bounds: 1 MiB of messages that cannot be skipped, or four whole surfaces; beyond that the
// connection is cut, and the page comes back to a fresh picture. The browser may send 300 messages
// a second. Thread: that of the browser's executor.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "server/session/pacing/allowance.h"
#include "server/session/pacing/frame_pacer.h"
#include "server/session/pacing/part_pacer.h"
#include "server/watch/page/bridge.h"
#include "server/watch/page/browser_socket.h"
#include "server/watch/page/join_request.h"

namespace trocar::page {

class Seat final : public Carried, public std::enable_shared_from_this<Seat> {
 public:
  // All references outlive finish().
  Seat(BrowserSocket& browser, Bridge& bridge, const JoinRequest& request);

  // Until he is refused, leaves, or has to go; the browser has been told why by then.
  asio::awaitable<void> run(const follow::SessionAddress& session);
  // After the browser's connection was cut.
  asio::awaitable<void> finish();
  void cut();
  const std::string& why() const { return why_; }

  void take(BytesView envelope, bool is_last) override;
  void hear(follow::News news, const wire::SharedBytes& framed) override;
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
  // Null: nothing is to be sent now.
  wire::SharedBytes next_message();
  wire::SharedBytes next_frame();
  wire::SharedBytes next_fine_part();
  bool awaits_fine_part() const;
  enum class Verdict { Done, ForSession, Forbidden };
  Verdict heed(BytesView envelope);
  Verdict heed_ack(Frame frame);
  void begin();
  void tell(const wire::SharedBytes& framed);
  void refuse(wire::EndReason reason, const std::string& text);
  void wake() { news_.cancel(); }

  BrowserSocket& browser_;
  Bridge& bridge_;
  const JoinRequest& request_;
  std::shared_ptr<Carrier> carrier_;
  std::uint32_t number_ = 0, slot_ = kNoSlot;
  bool is_welcome_ = false, has_begun_ = false;
  bool is_last_ = false;  // nothing is to follow what waits
  bool is_lost_ = false, is_cut_ = false, is_up_running_ = false;
  std::deque<wire::SharedBytes> waiting_;
  std::size_t waiting_bytes_ = 0, most_waiting_ = kMostWaitingBytes;
  std::optional<Frame> given_;
  bool is_state_told_ = true;
  wire::SharedBytes barrier_;
  std::uint64_t keyframe_ns_ = 0;
  pacing::FramePacer pacer_;
  pacing::PartPacer fine_parts_;
  std::uint64_t fine_ns_ = 0;   // when the last of them was sent
  pacing::Allowance messages_;  // that the browser may send
  asio::steady_timer news_, up_ended_;
  std::string why_;
};

}  // namespace trocar::page
